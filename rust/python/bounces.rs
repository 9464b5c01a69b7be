//! Paths of several reflections.

use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyReadonlyArray4,
};
use pyo3::prelude::*;

use super::arrays::{numbers, poses, vertices};
use super::paths::{AMPLITUDES_AT, DelaysAndAmplitudes, Nodes};
use super::scattering::{Material, materials, sampling};
use super::threads::compute;
use crate::antennas::array::Array;
use crate::bounces::{self, Launch, Limits};
use crate::error::Error;
use crate::geometry::pose::Pose;
use crate::paths::kinematics::Places;
use crate::paths::series::Selection;
use crate::rays::scene::Snapshot;

/// Routes over two and more surfaces; delays and amplitudes follow from where their bodies are.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Bounces {
    routes: bounces::Bounces,
    num_bodies: usize,
    counts: bounces::Counts,
}

impl Bounces {
    /// Those of the pixels of an image.
    #[allow(clippy::too_many_arguments)] // as Python hands them over
    pub(super) fn new(
        py: Python<'_>,
        snapshot: &Snapshot,
        launches: &[Launch],
        materials: Vec<PyRef<'_, Material>>,
        array: Array,
        is_footprint: bool,
        limits: Limits,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let num_bodies = snapshot.num_bodies();
        let materials = self::materials(&materials, num_bodies)?;
        let (routes, counts) = compute(py, threads, || {
            Ok(bounces::Bounces::new(
                snapshot,
                launches,
                &materials,
                array,
                limits,
                sampling(is_footprint),
            ))
        })?;
        Ok(Self {
            routes,
            num_bodies,
            counts,
        })
    }

    fn places<'a>(&self, num_nodes: usize, poses: &'a [Pose], vertices: &'a [&'a [[f64; 3]]]) -> Places<'a> {
        Places {
            num_nodes,
            num_bodies: self.num_bodies,
            poses,
            points: &[],
            rcs: &[],
            vertices,
        }
    }
}

#[pymethods]
impl Bounces {
    fn __len__(&self) -> usize {
        self.routes.len()
    }

    /// Rays from surfaces to the next, and tubes that ended at the floor.
    #[getter]
    fn counts(&self) -> (usize, usize) {
        (self.counts.rays, self.counts.stopped)
    }

    /// Number of the last body of every route.
    fn body<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_iter(py, self.routes.last_bodies())
    }

    /// Number of reflections of every route.
    fn order<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_iter(py, self.routes.orders().map(|order| order as u32))
    }

    /// Numbers of the bodies that deform and are met here, increasing.
    fn deforming<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        PyArray1::from_iter(py, self.routes.deforming().iter().map(|(body, _)| *body))
    }

    /// The routes over bodies for which `wanted` (body,) is true and no others, and all others.
    fn split(&self, wanted: PyReadonlyArray1<'_, bool>) -> PyResult<(Self, Self)> {
        let wanted = numbers("wanted", &wanted, [Some(self.num_bodies)])?;
        let [inside, others] = self.routes.split(|body| wanted[body as usize]).map(|routes| Self {
            routes,
            num_bodies: self.num_bodies,
            counts: self.counts,
        });
        Ok((inside, others))
    }

    /// Delay [s] and amplitude [sqrt(W)], (node, channel, route), of every `step`-th route from `first` up to `last`, with
    /// the bodies at `poses` (node, body, 3, 4). `vertices` has those of the bodies of `deforming` (node, vertex, 3).
    /// Amplitudes are those at `amplitudes_at`, which are such poses and vertices at other nodes.
    #[pyo3(signature = (poses, *, vertices=None, amplitudes_at=None, first=0, last=None, step=1, threads=None))]
    fn paths<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray4<'py, f64>,
        vertices: Option<Vec<PyReadonlyArray3<'py, f64>>>,
        amplitudes_at: Option<(PyReadonlyArray4<'py, f64>, Vec<PyReadonlyArray3<'py, f64>>)>,
        first: usize,
        last: Option<usize>,
        step: usize,
        threads: Option<usize>,
    ) -> PyResult<DelaysAndAmplitudes<'py>> {
        let (vertices, bodies) = (vertices.unwrap_or_default(), self.routes.deforming());
        let names = ["poses", "points", "vertices"];
        let nodes = Nodes::new(names, &poses, None, &vertices, self.num_bodies, bodies)?;
        let others = match &amplitudes_at {
            None => None,
            Some((poses, vertices)) => Some(Nodes::new(
                AMPLITUDES_AT,
                poses,
                None,
                vertices,
                self.num_bodies,
                bodies,
            )?),
        };
        let places = nodes.places(&[]);
        let amplitudes_at = others.as_ref().map_or(places, |nodes| nodes.places(&[]));
        let last = last.unwrap_or(self.routes.len());
        if step == 0 || last > self.routes.len() {
            let expected = format!("a step of at least 1 and at most {} routes", self.routes.len());
            return Err(Error::value("step, last", expected, format!("{step}, {last}")).into());
        }
        let selection = Selection { first, last, step };
        let paths = compute(py, threads, || self.routes.paths(&places, &amplitudes_at, selection))?;
        let shape = |nodes| [nodes, self.routes.num_channels(), selection.len()];
        Ok((
            paths.delay.into_pyarray(py).reshape(shape(places.num_nodes))?,
            paths
                .amplitude
                .into_pyarray(py)
                .reshape(shape(amplitudes_at.num_nodes))?,
        ))
    }

    /// Rate of every delay [s/s], (channel, route), from poses (body, 3, 4) and their time derivatives; likewise the
    /// vertices (vertex, 3) of the bodies of `deforming`.
    #[pyo3(signature = (poses, pose_rates, *, vertices=None, vertex_rates=None, threads=None))]
    fn delay_rates<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray3<'py, f64>,
        pose_rates: PyReadonlyArray3<'py, f64>,
        vertices: Option<Vec<PyReadonlyArray2<'py, f64>>>,
        vertex_rates: Option<Vec<PyReadonlyArray2<'py, f64>>>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let per_body = [Some(self.num_bodies), Some(3), Some(4)];
        let poses = self::poses(numbers("poses", &poses, per_body)?);
        let pose_rates = self::poses(numbers("pose_rates", &pose_rates, per_body)?);
        let (vertices, vertex_rates) = (vertices.unwrap_or_default(), vertex_rates.unwrap_or_default());
        let (bodies, shape) = (self.routes.deforming(), |n| [Some(n), Some(3)]);
        let vertices = self::vertices("vertices", bodies, &vertices, shape)?;
        let vertex_rates = self::vertices("vertex_rates", bodies, &vertex_rates, shape)?;
        let (places, rates) = (
            self.places(1, &poses, &vertices),
            self.places(1, &pose_rates, &vertex_rates),
        );
        let shape = [self.routes.num_channels(), self.routes.len()];
        let rates = compute(py, threads, || Ok(self.routes.delay_rates(&places, &rates)))?;
        rates.into_pyarray(py).reshape(shape)
    }
}
