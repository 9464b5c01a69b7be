//! Materials, samples of a scene, and scatterers of depth images.

use num_complex::Complex64;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::antennas::Antennas;
use super::arrays::{matrix, numbers, points};
use super::paths::Scatterers;
use super::threads::compute;
use crate::antennas::polarization::Seen;
use crate::error::{Error, Result};
use crate::paths::scatterers;
use crate::rays::camera::ImagePlane;
use crate::rays::hits;
use crate::rays::scene::Snapshot;
use crate::scattering::depth_image::Surfels;
use crate::scattering::material::{self, Dielectric, Response, Roughness};
use crate::scattering::patch;
use crate::scattering::physical_optics::Sampling;
use crate::scattering::samples;
use crate::scattering::sampling::Leaf;

/// What a surface does to waves of one frequency.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Material(pub(super) material::Material);

#[pymethods]
impl Material {
    /// The same at every angle; the field reflection coefficient as (real, imaginary).
    #[staticmethod]
    fn constant(reflection: (f64, f64), albedo: f64) -> Self {
        Self(material::Material::Constant(Response {
            reflection: Complex64::new(reflection.0, reflection.1),
            albedo,
        }))
    }

    /// What Fresnel says of a relative permittivity (real, imaginary), of a half-space or a slab of some thickness [m].
    /// `roughness`: rms height [m], none for a smooth surface; or `scattering`: the part of the field that is scattered.
    #[staticmethod]
    #[pyo3(signature = (permittivity, *, roughness=None, scattering=None, thickness=None))]
    fn dielectric(
        permittivity: (f64, f64),
        roughness: Option<f64>,
        scattering: Option<f64>,
        thickness: Option<f64>,
    ) -> PyResult<Self> {
        let roughness = match (roughness, scattering) {
            (None, None) => Roughness::Smooth,
            (Some(height), None) => Roughness::Height(height),
            (None, Some(part)) => Roughness::Scattering(part),
            (Some(_), Some(_)) => return Err(Error::value("scattering", "none with roughness", "both").into()),
        };
        Ok(Self(material::Material::Dielectric(Dielectric {
            permittivity: Complex64::new(permittivity.0, permittivity.1),
            thickness,
            roughness,
        })))
    }

    /// Field reflection coefficients and albedos at cosines of incidence (n,), as antennas see them that get the parts
    /// `te` and `tm` of both polarisations.
    #[pyo3(signature = (cosine, *, wavelength, te, tm))]
    fn response<'py>(
        &self,
        py: Python<'py>,
        cosine: PyReadonlyArray1<'_, f64>,
        wavelength: f64,
        te: f64,
        tm: f64,
    ) -> PyResult<ResponseArrays<'py>> {
        let cosines = numbers("cosine", &cosine, [None])?.iter();
        let of = |cosine: &f64| self.0.response(*cosine, wavelength, Seen { te, tm });
        let (reflection, albedo): (Vec<_>, Vec<_>) = cosines.map(of).map(|r| (r.reflection, r.albedo)).unzip();
        Ok((reflection.into_pyarray(py), albedo.into_pyarray(py)))
    }
}

pub(super) type ResponseArrays<'py> = (Bound<'py, PyArray1<Complex64>>, Bound<'py, PyArray1<f64>>);

/// One material per body.
pub(super) fn materials(materials: &[PyRef<'_, Material>], num_bodies: usize) -> Result<Vec<material::Material>> {
    if materials.len() != num_bodies {
        let expected = format!("{num_bodies}, one per body");
        return Err(Error::value("materials", expected, materials.len()));
    }
    Ok(materials.iter().map(|material| material.0).collect())
}

/// Cells of the image plane, fine where they need to be, and what their rays hit.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Samples {
    pub(super) snapshot: Snapshot,
    pub(super) samples: samples::Samples,
}

#[pymethods]
impl Samples {
    fn __len__(&self) -> usize {
        self.samples.leaves.len()
    }

    /// Rays that were cast, bundles of rays that were skipped and taken over, and cells that could have been split.
    #[getter]
    fn counts(&self) -> (usize, usize, usize, usize) {
        let hits::Counts {
            rays,
            tiles_skipped,
            tiles_reused,
        } = self.samples.counts;
        (rays, tiles_skipped, tiles_reused, self.samples.num_coarse())
    }

    /// Centre (u, v) and widths of the cells that hit something, (cell, 4).
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = self
            .samples
            .leaves
            .iter()
            .map(|leaf| leaf.cell)
            .map(|c| [c.u, c.v, c.du, c.dv]);
        matrix(py, rows.collect())
    }

    /// Number of the body that every cell hit, (cell,).
    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i32>> {
        PyArray1::from_iter(py, self.samples.leaves.iter().map(|leaf| leaf.found.body.cast_signed()))
    }

    /// Distance along the ray [m], (cell,).
    fn distance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.samples.leaves.iter().map(|leaf| leaf.found.to_facet))
    }

    /// Unit direction of the ray of a cell in the sensor frame.
    fn direction(&self, cell: usize) -> PyResult<[f64; 3]> {
        Ok(self.leaf(cell)?.cell.direction().to_array())
    }

    /// The vertices of the triangle that a cell hit and their weights there.
    fn place_on_mesh(&self, cell: usize) -> PyResult<([u32; 3], [f64; 3])> {
        let Leaf { cell, found, .. } = self.leaf(cell)?;
        Ok(patch::place_on_mesh(&self.snapshot, cell, found.body, found.triangle))
    }

    /// Material points of all cells that send anything back; `materials` has one per body.
    #[pyo3(signature = (materials, *, antennas, threads=None))]
    fn scatterers(
        &self,
        py: Python<'_>,
        materials: Vec<PyRef<'_, Material>>,
        antennas: PyRef<'_, Antennas>,
        threads: Option<usize>,
    ) -> PyResult<Scatterers> {
        let materials = self::materials(&materials, self.snapshot.num_bodies())?;
        let array = antennas.0.clone();
        let scatterers = compute(py, threads, || {
            let (snapshot, samples) = (&self.snapshot, &self.samples);
            Ok(scatterers::Scatterers::of_samples(snapshot, samples, &materials, array))
        })?;
        Ok(Scatterers {
            scatterers,
            num_bodies: self.snapshot.num_bodies(),
        })
    }
}

impl Samples {
    pub(super) fn leaf(&self, number: usize) -> Result<&Leaf> {
        let expected = || format!("a number below {}", self.samples.leaves.len());
        let leaf = self.samples.leaves.get(number);
        leaf.ok_or_else(|| Error::value("cell", expected(), number))
    }
}

/// Material points of the surface elements of an image that send anything back; the bodies' frames are the sensor frame.
#[pyfunction(signature = (
    distance, normals, reflection, albedo, body, *, num_bodies, focal_length, principal_point, antennas, is_footprint, seed,
    threads=None
))]
pub(super) fn image_scatterers(
    py: Python<'_>,
    distance: PyReadonlyArray2<'_, f64>,
    normals: PyReadonlyArray3<'_, f64>,
    reflection: PyReadonlyArray2<'_, Complex64>,
    albedo: PyReadonlyArray2<'_, f64>,
    body: PyReadonlyArray2<'_, i32>,
    num_bodies: usize,
    focal_length: (f64, f64),
    principal_point: (f64, f64),
    antennas: PyRef<'_, Antennas>,
    is_footprint: bool,
    seed: u64,
    threads: Option<usize>,
) -> PyResult<Scatterers> {
    let [rows, columns] = *distance.shape() else {
        unreachable!("two axes")
    };
    let image = [Some(rows), Some(columns)];
    let normal = points(numbers("normals", &normals, [image[0], image[1], Some(3)])?);
    let surfels = Surfels {
        plane: ImagePlane {
            rows,
            columns,
            du: focal_length.0.recip(),
            dv: focal_length.1.recip(),
            axis_column: principal_point.0,
            axis_row: principal_point.1,
        },
        distance: numbers("distance", &distance, image)?,
        normal: &normal,
        reflection: numbers("reflection", &reflection, image)?,
        albedo: numbers("albedo", &albedo, image)?,
        body: numbers("body", &body, image)?,
        num_bodies,
    };
    let array = antennas.0.clone();
    let scatterers = compute(py, threads, || {
        scatterers::Scatterers::from_surfels(&surfels, array, sampling(is_footprint), seed)
    })?;
    Ok(Scatterers { scatterers, num_bodies })
}

pub(super) fn sampling(is_footprint: bool) -> Sampling {
    if is_footprint {
        Sampling::Footprint
    } else {
        Sampling::Point
    }
}
