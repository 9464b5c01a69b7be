//! Scatterers and their paths at the times of a frame.

use glam::DVec3;
use num_complex::Complex64;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyReadonlyArray4, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use super::arrays::{numbers, points, poses, vertices};
use super::threads::compute;
use crate::error::Error;
use crate::geometry::pose::Pose;
use crate::paths::kinematics::Places;
use crate::paths::scatterers;
use crate::paths::series::Selection;

/// Material points; delays and amplitudes follow from where their bodies are.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Scatterers {
    pub(super) scatterers: scatterers::Scatterers,
    pub(super) num_bodies: usize,
}

pub(super) type DelaysAndAmplitudes<'py> = (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray3<Complex64>>);

#[pymethods]
impl Scatterers {
    fn __len__(&self) -> usize {
        self.scatterers.len()
    }

    /// Number of the body of every material point.
    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.scatterers.bodies())
    }

    /// Number of the cell of every material point: of the pixel, row by row, or of the cell of samples.
    fn cell<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_slice(py, self.scatterers.cells())
    }

    /// Numbers of the bodies that deform and have material points here, increasing.
    fn deforming<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_iter(py, self.scatterers.deforming().iter().map(|(body, _)| *body))
    }

    /// By which power of the frequency the field of every material point falls.
    fn order<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        PyArray1::from_slice(py, self.scatterers.orders())
    }

    /// The material points of the bodies for which `wanted` (body,) is true, and of an order, in the same order.
    fn select(&self, wanted: PyReadonlyArray1<'_, bool>, order: u8) -> PyResult<Self> {
        let wanted = numbers("wanted", &wanted, [Some(self.num_bodies)])?;
        Ok(Self {
            scatterers: self.scatterers.select(|body, of| wanted[body as usize] && of == order),
            num_bodies: self.num_bodies,
        })
    }

    /// Delay [s] and amplitude [sqrt(W)], (node, channel, path), of every `step`-th path from `first` up to `last`:
    /// first the material points with their bodies at `poses` (node, body, 3, 4), then the point targets at `points`
    /// (node, point, 3). `vertices` has those of the bodies of `deforming` (node, vertex, 3). Amplitudes are those at
    /// `amplitudes_at`, which are such poses, points and vertices at other nodes.
    #[pyo3(signature = (
        poses, points, rcs, *, vertices=None, amplitudes_at=None, first=0, last=None, step=1, threads=None
    ))]
    fn paths<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray4<'py, f64>,
        points: PyReadonlyArray3<'py, f64>,
        rcs: PyReadonlyArray1<'py, f64>,
        vertices: Option<Vec<PyReadonlyArray3<'py, f64>>>,
        amplitudes_at: Option<PosesPointsVertices<'py>>,
        first: usize,
        last: Option<usize>,
        step: usize,
        threads: Option<usize>,
    ) -> PyResult<DelaysAndAmplitudes<'py>> {
        let rcs = numbers("rcs", &rcs, [None])?;
        let bodies = self.scatterers.deforming();
        let vertices = vertices.unwrap_or_default();
        let names = ["poses", "points", "vertices"];
        let nodes = Nodes::new(
            names,
            &poses,
            Some((&points, rcs.len())),
            &vertices,
            self.num_bodies,
            bodies,
        )?;
        let others = match &amplitudes_at {
            None => None,
            Some((poses, points, vertices)) => {
                let points = Some((points, rcs.len()));
                Some(Nodes::new(
                    AMPLITUDES_AT,
                    poses,
                    points,
                    vertices,
                    self.num_bodies,
                    bodies,
                )?)
            }
        };
        let places = nodes.places(rcs);
        let amplitudes_at = others.as_ref().map_or(places, |nodes| nodes.places(rcs));
        let num_paths = self.scatterers.len() + rcs.len();
        let last = last.unwrap_or(num_paths);
        if step == 0 || last > num_paths {
            let expected = format!("a step of at least 1 and at most {num_paths} paths");
            return Err(Error::value("step, last", expected, format!("{step}, {last}")).into());
        }
        let selection = Selection { first, last, step };
        let paths = compute(py, threads, || {
            self.scatterers.paths(&places, &amplitudes_at, selection)
        })?;
        let shape = |nodes| [nodes, self.scatterers.num_channels(), selection.len()];
        Ok((
            paths.delay.into_pyarray(py).reshape(shape(places.num_nodes))?,
            paths
                .amplitude
                .into_pyarray(py)
                .reshape(shape(amplitudes_at.num_nodes))?,
        ))
    }

    /// Rate of every delay [s/s], (channel, path), from poses (body, 3, 4) and points (point, 3) and their time
    /// derivatives; likewise the vertices (vertex, 3) of the bodies of `deforming`.
    #[pyo3(signature = (poses, pose_rates, points, point_rates, *, vertices=None, vertex_rates=None, threads=None))]
    fn delay_rates<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray3<'py, f64>,
        pose_rates: PyReadonlyArray3<'py, f64>,
        points: PyReadonlyArray2<'py, f64>,
        point_rates: PyReadonlyArray2<'py, f64>,
        vertices: Option<Vec<PyReadonlyArray2<'py, f64>>>,
        vertex_rates: Option<Vec<PyReadonlyArray2<'py, f64>>>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let per_body = [Some(self.num_bodies), Some(3), Some(4)];
        let poses = self::poses(numbers("poses", &poses, per_body)?);
        let pose_rates = self::poses(numbers("pose_rates", &pose_rates, per_body)?);
        let per_point = [Some(points.shape()[0]), Some(3)];
        let point_rates = self::points(numbers("point_rates", &point_rates, per_point)?);
        let points = self::points(numbers("points", &points, per_point)?);
        let (vertices, vertex_rates) = (vertices.unwrap_or_default(), vertex_rates.unwrap_or_default());
        let shape = |n| [Some(n), Some(3)];
        let bodies = self.scatterers.deforming();
        let vertices = self::vertices("vertices", bodies, &vertices, shape)?;
        let vertex_rates = self::vertices("vertex_rates", bodies, &vertex_rates, shape)?;
        let places = self.places(1, &poses, &points, &[], &vertices);
        let rates = self.places(1, &pose_rates, &point_rates, &[], &vertex_rates);
        let shape = [self.scatterers.num_channels(), self.scatterers.len() + points.len()];
        let rates = compute(py, threads, || Ok(self.scatterers.delay_rates(&places, &rates)))?;
        rates.into_pyarray(py).reshape(shape)
    }
}

impl Scatterers {
    pub(super) fn places<'a>(
        &self,
        num_nodes: usize,
        poses: &'a [Pose],
        points: &'a [DVec3],
        rcs: &'a [f64],
        vertices: &'a [&'a [[f64; 3]]],
    ) -> Places<'a> {
        Places {
            num_nodes,
            num_bodies: self.num_bodies,
            poses,
            points,
            rcs,
            vertices,
        }
    }
}

/// Poses (node, body, 3, 4), points (node, point, 3), and vertices (node, vertex, 3) of every body that deforms.
pub(super) type PosesPointsVertices<'py> = (
    PyReadonlyArray4<'py, f64>,
    PyReadonlyArray3<'py, f64>,
    Vec<PyReadonlyArray3<'py, f64>>,
);

/// Names of the parts of an argument.
pub(super) const AMPLITUDES_AT: [&str; 3] = ["amplitudes_at[0]", "amplitudes_at[1]", "amplitudes_at[-1]"];

/// Where everything is at some nodes, as the core takes it.
pub(super) struct Nodes<'a> {
    pub(super) number: usize,
    pub(super) num_bodies: usize,
    pub(super) poses: Vec<Pose>,
    pub(super) points: Vec<DVec3>,
    pub(super) vertices: Vec<&'a [[f64; 3]]>,
}

impl<'a> Nodes<'a> {
    /// Refuses shapes that do not fit together; `names` are those of the arrays, the points come with their number.
    pub(super) fn new(
        names: [&str; 3],
        poses: &PyReadonlyArray4<'_, f64>,
        points: Option<(&PyReadonlyArray3<'_, f64>, usize)>,
        vertices: &'a [PyReadonlyArray3<'_, f64>],
        num_bodies: usize,
        deforming: &[(u32, usize)],
    ) -> PyResult<Self> {
        let number = poses.shape()[0];
        let poses = self::poses(numbers(names[0], poses, [None, Some(num_bodies), Some(3), Some(4)])?);
        let points = match points {
            None => Vec::new(),
            Some((points, num_points)) => {
                self::points(numbers(names[1], points, [Some(number), Some(num_points), Some(3)])?)
            }
        };
        Ok(Self {
            number,
            num_bodies,
            poses,
            points,
            vertices: self::vertices(names[2], deforming, vertices, |n| [Some(number), Some(n), Some(3)])?,
        })
    }

    pub(super) fn places<'b>(&'b self, rcs: &'b [f64]) -> Places<'b> {
        Places {
            num_nodes: self.number,
            num_bodies: self.num_bodies,
            poses: &self.poses,
            points: &self.points,
            rcs,
            vertices: &self.vertices,
        }
    }
}
