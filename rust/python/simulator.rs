//! Frames, paths and images of a simulator: arrays of poses and positions in, arrays of samples out.

use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;
use num_complex::Complex64;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4,
    PyReadonlyArray5, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};
use rayon::ThreadPool;
use rayon::prelude::*;

use super::antennas::PyAntennas;
use super::arrays::{numbers, points, poses};
use super::rays::{PySurface, image_arrays};
use super::scattering::PyMaterial;
use super::settings::{Plane, SettingsFields};
use super::synthesis::{PyWaveform, samples_array};
use super::threads::{check_threads, new_pool, pool, watch};
use crate::cancel::Cancel;
use crate::error::{Error, Result};
use crate::frame::{self, Answer, FrameCounts, Memory, Model, Source};
use crate::paths::kinematics::{TimeSeries, World};
use crate::rays::camera::ImagePlane;
use crate::scattering::surface_image::SurfaceImage;

/// Body with a surface, and whether its vertices move; or cross-section of a point target [m^2].
#[derive(FromPyObject)]
pub(super) enum Target<'py> {
    Body(PyRef<'py, PySurface>, bool),
    Point(f64),
}

/// Bodies and point targets.
#[pyclass(frozen, name = "Scene", module = "radarcore._core")]
pub(super) struct PyScene(frame::Scene);

#[pymethods]
impl PyScene {
    #[new]
    fn new(targets: Vec<Target<'_>>) -> Self {
        let mut scene = frame::Scene::default();
        for (number, target) in targets.into_iter().enumerate() {
            match target {
                Target::Body(surface, deforms) => {
                    scene.deforming.extend(deforms.then_some(scene.surfaces.len()));
                    scene.surfaces.push(surface.0.clone());
                    scene.body_numbers.push(number);
                }
                Target::Point(rcs) => {
                    scene.rcs.push(rcs);
                    scene.point_numbers.push(number);
                }
            }
        }
        Self(scene)
    }
}

/// Surface elements of a depth image, one per pixel.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct DepthScene(Arc<SurfaceImage>);

#[pymethods]
impl DepthScene {
    /// Build from an image plane and arrays (rows, columns) of distances along the ray [m], unit normals towards the
    /// sensor, field reflection coefficients, albedos, bodies, and of range rates [m/s] beside the motion of the bodies;
    /// the start of the frame is `age` [s] after the image.
    #[new]
    #[pyo3(signature = (
        plane, distance, normals, reflection, albedo, body, *, num_bodies, range_rate=None, age=0.0
    ))]
    fn new(
        plane: Plane,
        distance: PyReadonlyArray2<'_, f64>,
        normals: PyReadonlyArray3<'_, f64>,
        reflection: PyReadonlyArray2<'_, Complex64>,
        albedo: PyReadonlyArray2<'_, f64>,
        body: PyReadonlyArray2<'_, i32>,
        num_bodies: usize,
        range_rate: Option<PyReadonlyArray2<'_, f64>>,
        age: f64,
    ) -> PyResult<Self> {
        let plane = ImagePlane::from(plane);
        let image = [Some(plane.rows), Some(plane.columns)];
        let rates = range_rate.as_ref();
        let rates = rates.map(|rates| PyResult::Ok(numbers("range_rate", rates, image)?.to_vec()));
        Ok(Self(Arc::new(SurfaceImage {
            plane,
            distance: numbers("distance", &distance, image)?.to_vec(),
            normal: points(numbers("normals", &normals, [image[0], image[1], Some(3)])?),
            reflection: numbers("reflection", &reflection, image)?.to_vec(),
            albedo: numbers("albedo", &albedo, image)?.to_vec(),
            body: numbers("body", &body, image)?.to_vec(),
            num_bodies,
            range_rate: rates.transpose()?,
            age,
        })))
    }
}

/// Scene or depth image.
#[derive(FromPyObject)]
pub(super) enum AnySource<'py> {
    Scene(PyRef<'py, PyScene>),
    Depth(PyRef<'py, DepthScene>),
}

/// Poses and positions in the world at Chebyshev times of a frame, or their time derivatives at one time.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Placement(World);

#[pymethods]
impl Placement {
    /// Build from ``[rotation | position]`` of the sensor (time, 3, 4) and of bodies (time, body, 3, 4), positions of
    /// point targets (time, point, 3) [m], and for every body that deforms its vertices (time, vertex, 3) in body
    /// coordinates [m], at the number of Chebyshev times of that array.
    #[new]
    #[pyo3(signature = (sensor, poses, points, vertices=Vec::new()))]
    fn new(
        sensor: PyReadonlyArray3<'_, f64>,
        poses: PyReadonlyArray4<'_, f64>,
        points: PyReadonlyArray3<'_, f64>,
        vertices: Vec<PyReadonlyArray3<'_, f64>>,
    ) -> PyResult<Self> {
        let times = sensor.shape()[0];
        if times % 2 == 0 {
            return Err(Error::value("sensor", "an odd number of times", times).into());
        }
        let vertices = vertices.iter().map(|array| {
            let positions = self::points(numbers("vertices", array, [None, None, Some(3)])?);
            PyResult::Ok(TimeSeries::new(array.shape()[0], positions))
        });
        Ok(Self(World {
            sensor: self::poses(numbers("sensor", &sensor, [None, Some(3), Some(4)])?),
            poses: self::poses(numbers("poses", &poses, [Some(times), None, Some(3), Some(4)])?),
            points: self::points(numbers("points", &points, [Some(times), None, Some(3)])?),
            vertices: vertices.collect::<PyResult<_>>()?,
        }))
    }
}

/// Ideal beat signal of a frame, its truth, and counts; see the stub.
#[pyclass(frozen, get_all, module = "radarcore._core")]
pub(super) struct IdealFrame {
    cube: Py<PyAny>,
    truth: Option<Py<PyArray2<f64>>>,
    farthest: f64,
    series_errors: (f64, f64),
    bounce_error: f64,
    rcs_floor: Option<f64>,
    fast_varying: Vec<usize>,
    counts: Py<PyDict>,
    stage_times: Vec<(&'static str, f64)>,
    plan: String,
}

impl IdealFrame {
    /// Frame of a simulator; None where its motion needs more times.
    fn new(py: Python<'_>, model: &Model, answer: Answer) -> PyResult<Option<Self>> {
        let Answer::Done(frame) = answer else {
            return Ok(None);
        };
        let truth = frame.truth.map(|truth| {
            let rows: Vec<f64> = (0..4).flat_map(|row| truth.iter().map(move |body| body[row])).collect();
            rows.into_pyarray(py).reshape([4, truth.len()])
        });
        let counts = frame.counts;
        let nodes = &counts.node_times;
        Ok(Some(Self {
            cube: samples_array(py, frame.cube, model.shape())?.unbind(),
            truth: truth.transpose()?.map(Bound::unbind),
            farthest: counts.farthest,
            series_errors: (nodes.phase.max(counts.motion_error), nodes.weight),
            bounce_error: counts.bounce_error(),
            rcs_floor: counts.rcs_floor,
            counts: dict_of_counts(py, &counts)?.unbind(),
            fast_varying: counts.fast_varying,
            stage_times: counts.times,
            plan: if counts.plan.is_empty() {
                "no paths".to_owned()
            } else {
                counts.plan.join("\n")
            },
        }))
    }
}

/// Values of fields, by their names.
macro_rules! by_name {
    ($of:expr, $($field:ident),+) => { [$((stringify!($field), $of.$field)),+] };
}

/// Counts of rays, hits, tiles, paths and node times, by name.
fn dict_of_counts<'py>(py: Python<'py>, counts: &FrameCounts) -> PyResult<Bound<'py, PyDict>> {
    let all = by_name!(counts, casts, rays_cast, rays_hit, tiles_skipped, tiles_reused).into_py_dict(py)?;
    if let Some(number) = counts.cells_not_split {
        all.set_item("cells_not_split", number)?;
    }
    let paths = by_name!(
        counts,
        paths,
        paths_skipped,
        bounce_paths,
        bounce_rays,
        bounces_stopped,
        bounces_not_split
    );
    for (name, number) in paths {
        all.set_item(name, number)?;
    }
    all.set_item("delay_nodes", counts.node_times.delays)?;
    all.set_item("amplitude_nodes", counts.node_times.amplitudes)?;
    all.set_item("still_paths", counts.static_paths)?;
    Ok(all)
}

/// Simulator of frames, paths and images; keeps the hits of static tiles from one frame to the next.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Simulator {
    model: Model,
    memory: Mutex<Memory>,
    /// Of every world of `worlds`.
    memories: Mutex<Vec<Memory>>,
    /// Request to stop the run in progress.
    in_progress: Mutex<Option<Arc<Cancel>>>,
    threads: Option<usize>,
    /// Threads that no other simulator has.
    own_pool: Option<Arc<ThreadPool>>,
}

#[pymethods]
impl Simulator {
    /// `materials`: one per body with a surface; `center`: middle of the array in sensor axes (x, y, z) [m];
    /// `own_threads`: the number of threads is given, and other simulators have none of them.
    #[new]
    #[pyo3(signature = (source, materials, *, antennas, waveform, center, settings, threads=None, own_threads=false))]
    fn new(
        source: AnySource<'_>,
        materials: Vec<PyRef<'_, PyMaterial>>,
        antennas: PyRef<'_, PyAntennas>,
        waveform: PyRef<'_, PyWaveform>,
        center: [f64; 3],
        settings: SettingsFields,
        threads: Option<usize>,
        own_threads: bool,
    ) -> PyResult<Self> {
        check_threads(threads)?;
        let own_pool = threads.filter(|_| own_threads).map(new_pool).transpose()?;
        let source = match source {
            AnySource::Scene(scene) => Source::Scene(scene.0.clone()),
            AnySource::Depth(image) => Source::Depth(image.0.clone()),
        };
        let model = Model::new(
            source,
            materials.iter().map(|material| material.0).collect(),
            antennas.0.clone(),
            waveform.0.clone(),
            DVec3::from_array(center),
            settings.try_into()?,
        )?;
        Ok(Self {
            model,
            memory: Mutex::default(),
            memories: Mutex::default(),
            in_progress: Mutex::default(),
            threads,
            own_pool: own_pool.map(Arc::new),
        })
    }

    /// Simulate the frame of a motion, given at Chebyshev times of the frame; `rates`: time derivatives, for a frame of a
    /// single sample. None where the motion needs more times.
    #[pyo3(signature = (motion, rates=None))]
    fn frame(
        &self,
        py: Python<'_>,
        motion: PyRef<'_, Placement>,
        rates: Option<PyRef<'_, Placement>>,
    ) -> PyResult<Option<IdealFrame>> {
        let (motion, rates) = (&motion.0, rates.as_ref().map(|rates| &rates.0));
        let simulated = self.run(py, &self.memory, |memory, cancel| {
            frame::simulate(&self.model, motion, rates, memory, cancel)
        })?;
        IdealFrame::new(py, &self.model, simulated)
    }

    /// Frames of worlds that differ in their motion alone. `moved`: poses (time, world, n, 3, 4) that take the place of
    /// the `own` ones, of the bodies `rows`: bodies, the sensor and points are counted in this order.
    fn worlds(
        &self,
        py: Python<'_>,
        own: PyRef<'_, Placement>,
        moved: PyReadonlyArray5<'_, f64>,
        rows: Vec<usize>,
    ) -> PyResult<Option<Vec<IdealFrame>>> {
        let (own, number, placed) = (&own.0, moved.shape()[1], rows.len());
        let times = own.sensor.len();
        let [bodies, points] = [own.poses.len(), own.points.len()].map(|number| number / times);
        if rows.iter().any(|row| *row > bodies + points) {
            return Err(Error::value("rows", format!("at most {}", bodies + points), format!("{rows:?}")).into());
        }
        let moved = poses(numbers(
            "moved",
            &moved,
            [Some(times), None, Some(placed), Some(3), Some(4)],
        )?);
        let world_of = |index: usize| {
            let mut world = own.clone();
            for time in 0..times {
                let moved = &moved[(time * number + index) * placed..][..placed];
                for (&row, &pose) in rows.iter().zip(moved) {
                    match row.checked_sub(bodies) {
                        None => world.poses[time * bodies + row] = pose,
                        Some(0) => world.sensor[time] = pose,
                        Some(point) => world.points[time * points + point - 1] = pose.translation,
                    }
                }
            }
            world
        };
        let answers = self.run(py, &self.memories, |memories, cancel| {
            memories.resize_with(number, Memory::default);
            let worlds = memories.par_iter_mut().enumerate();
            let frames =
                worlds.map(|(world, memory)| frame::simulate(&self.model, &world_of(world), None, memory, cancel));
            frames.collect::<Result<Vec<_>>>()
        })?;
        let frames = answers
            .into_iter()
            .map(|answer| IdealFrame::new(py, &self.model, answer));
        frames.collect()
    }

    /// Stop the run in progress in another thread, if there is one: it ends between two stages, with an error.
    fn stop(&self) {
        let cancel = self.in_progress.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cancel) = &*cancel {
            cancel.ask();
        }
    }

    /// Delays [s], delay rates [s/s] and amplitudes [sqrt(W)] (channel, path), and bodies and orders (path,), at the
    /// time of the kinematics `at` with time derivatives `rates_at`, from the rays of the first part of a frame.
    fn paths<'py>(
        &self,
        py: Python<'py>,
        motion: PyRef<'_, Placement>,
        at: PyRef<'_, Placement>,
        rates_at: PyRef<'_, Placement>,
    ) -> PyResult<impl IntoPyObject<'py>> {
        let (frame, at) = (&motion.0, (&at.0, &rates_at.0));
        let paths = self.run(py, &self.memory, |memory, cancel| {
            frame::paths(&self.model, frame, at, memory, cancel)
        })?;
        let shape = [self.model.array.num_channels(), paths.body.len()];
        Ok((
            paths.delay.into_pyarray(py).reshape(shape)?,
            paths.delay_rate.into_pyarray(py).reshape(shape)?,
            paths.amplitude.into_pyarray(py).reshape(shape)?,
            paths.body.into_pyarray(py),
            paths.frequency_exponent.into_pyarray(py),
        ))
    }

    /// Hits of the rays of an image with the kinematics `at` one time.
    fn image<'py>(&self, py: Python<'py>, at: PyRef<'_, Placement>) -> PyResult<impl IntoPyObject<'py>> {
        let at = &at.0;
        let hits = self.run(py, &self.memory, |memory, cancel| {
            frame::image(&self.model, at, memory, cancel)
        })?;
        image_arrays(py, hits)
    }

    /// Points (n, 3) of the sensor frame, about the middle of the array, that a body occludes.
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        at: PyRef<'_, Placement>,
        points: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let at = &at.0;
        let points = self::points(numbers("points", &points, [None, Some(3)])?);
        let is_occluded = self.run(py, &self.memory, |memory, _| {
            frame::occluded(&self.model, at, &points, memory)
        })?;
        Ok(is_occluded.into_pyarray(py))
    }
}

impl Simulator {
    /// Run a function on the threads of the simulator, without the interpreter, until Ctrl-C.
    fn run<M: Send, T: Send>(
        &self,
        py: Python<'_>,
        memory: &Mutex<M>,
        work: impl FnOnce(&mut M, &Cancel) -> Result<T> + Send,
    ) -> PyResult<T> {
        let pool = match &self.own_pool {
            Some(own) => own.clone(),
            None => pool(self.threads)?,
        };
        let cancel = Arc::new(Cancel::default());
        // A second thread of the interpreter waits here for the first.
        py.detach(|| {
            let mut memory = memory.lock().unwrap_or_else(PoisonError::into_inner);
            let in_progress = |run| {
                *self.in_progress.lock().unwrap_or_else(PoisonError::into_inner) = run;
            };
            in_progress(Some(cancel.clone()));
            let memory = &mut *memory;
            let result = watch(&pool, &cancel, None, || work(memory, &cancel));
            in_progress(None);
            result
        })
    }
}
