//! Material points during gathering, in arrays.

use std::collections::HashMap;

use glam::DVec3;
use num_complex::Complex64;

use crate::antennas::array::Array;
use crate::paths::scatterers::{Scatterers, Weight};
use crate::scattering::material_frame::MaterialFrame;
use crate::scattering::patch::Patch;

/// Cell number of points without a cell.
pub const NO_CELL: u32 = u32::MAX;

/// Memory of a material point, without its weights [bytes].
pub(crate) const POINT_SIZE: usize = size_of::<(u32, u32, u8, Option<[u32; 3]>, [DVec3; 2], [DVec3; 2], f64, u64)>();

/// Material points in the order of gathering; see [`Scatterers`].
#[derive(Default)]
pub(crate) struct Points {
    pub(crate) cell: Vec<u32>,
    pub(crate) body: Vec<u32>,
    pub(crate) order: Vec<u8>,
    pub(crate) corners: Vec<Option<[u32; 3]>>,
    pub(crate) position: Vec<DVec3>,
    pub(crate) normal: Vec<DVec3>,
    pub(crate) patch: Vec<[DVec3; 2]>,
    /// Weights `(point, channel)`.
    pub(crate) weights: Vec<Weight>,
    /// Area of the patch [m^2].
    pub(crate) area: Vec<f64>,
    /// Number of the cube that gives the diffuse phase.
    pub(crate) cube: Vec<u64>,
}

/// Sample of a surface: position and size of the patch of one material point.
#[derive(Clone, Copy)]
pub(crate) struct SurfaceSample {
    /// Position in the material frame [m].
    pub(crate) position: DVec3,
    pub(crate) edges: [DVec3; 2],
    pub(crate) order: u8,
    /// Area [m^2], and number of the cube that gives the diffuse phase.
    pub(crate) area: f64,
    pub(crate) cube: u64,
}

impl Points {
    /// Append a sample whose weights were appended before; a sample without power is dropped with its weights.
    pub(crate) fn push(&mut self, patch: &Patch, frame: &MaterialFrame, sample: SurfaceSample, num_channels: usize) {
        let first = self.weights.len() - num_channels;
        if self.weights[first..].iter().all(Weight::is_silent) {
            self.weights.truncate(first);
            return;
        }
        self.cell.push(patch.index as u32);
        self.body.push(patch.body);
        self.order.push(sample.order);
        self.corners.push(frame.moved.as_ref().map(|moved| moved.vertices));
        self.position.push(sample.position);
        self.normal.push(frame.normal(patch.normal));
        self.patch.push(sample.edges);
        self.area.push(sample.area);
        self.cube.push(sample.cube);
    }

    pub(crate) fn with_array(self, array: Array) -> Scatterers {
        Scatterers {
            cell: self.cell,
            body: self.body,
            frequency_exponent: self.order,
            corners: self.corners,
            position: self.position,
            normal: self.normal,
            patch: self.patch,
            weights: self.weights,
            rcs: Vec::new(),
            array,
        }
    }

    pub(crate) fn append(&mut self, mut other: Self) {
        self.cell.append(&mut other.cell);
        self.body.append(&mut other.body);
        self.order.append(&mut other.order);
        self.corners.append(&mut other.corners);
        self.position.append(&mut other.position);
        self.normal.append(&mut other.normal);
        self.patch.append(&mut other.patch);
        self.weights.append(&mut other.weights);
        self.area.append(&mut other.area);
        self.cube.append(&mut other.cube);
    }

    /// Scale the diffuse weights of points that share a cube. Equal phases add up as fields, not as powers; the scaled
    /// power of a cube is that of its area for any number of cells.
    pub(crate) fn share_speckle(&mut self, num_channels: usize) {
        let is_diffuse = |weights: &[Weight]| weights.iter().any(|w| w.diffuse != Complex64::ZERO);
        let mut areas: HashMap<u64, f64> = HashMap::new();
        for (point, weights) in self.weights.chunks(num_channels.max(1)).enumerate() {
            if is_diffuse(weights) {
                *areas.entry(self.cube[point]).or_default() += self.area[point];
            }
        }
        for (point, weights) in self.weights.chunks_mut(num_channels.max(1)).enumerate() {
            if is_diffuse(weights) {
                let share = (self.area[point] / areas[&self.cube[point]]).sqrt();
                for weight in weights {
                    weight.diffuse *= share;
                }
            }
        }
    }
}
