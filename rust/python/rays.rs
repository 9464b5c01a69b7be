//! Surfaces, scenes of them, and hits of images.

use std::sync::{Arc, OnceLock};

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use super::antennas::Antennas;
use super::arrays::{numbers, points, poses};
use super::bounces::Bounces;
use super::paths::Scatterers;
use super::scattering::{Material, Samples, materials, sampling};
use super::threads::{check_threads, compute};
use crate::antennas::beam::Beam;
use crate::bounces::{Launch, Limits};
use crate::error::Error;
use crate::geometry::pose::Pose;
use crate::paths::scatterers;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::{self, Cast};
use crate::rays::scene::{NO_BODY, Snapshot};
use crate::rays::smooth_hits::Shown;
use crate::rays::surface::{self, ShadingMode};
use crate::scattering::samples;
use crate::scattering::sampling::Rule;
use crate::scattering::{patch, reflectance};

/// Triangles, tree and shading of one body.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Surface(pub(super) Arc<surface::Surface>);

#[pymethods]
impl Surface {
    #[new]
    #[pyo3(signature = (vertices, triangles, *, crease_angle=None, report=None))]
    fn new(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        triangles: PyReadonlyArray2<'_, u32>,
        crease_angle: Option<f64>,
        report: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let vertices = points(numbers("vertices", &vertices, [None, Some(3)])?);
        let triangles = numbers("triangles", &triangles, [None, Some(3)])?
            .as_chunks()
            .0
            .to_vec();
        let mode = crease_angle.map_or(ShadingMode::Flat, |crease_angle| ShadingMode::Smooth { crease_angle });
        let tell = |share: f64| {
            if let Some(report) = &report {
                Python::attach(|py| {
                    if let Err(error) = report.call1(py, (share,)) {
                        error.write_unraisable(py, Some(report.bind(py)));
                    }
                });
            }
        };
        let surface = compute(py, None, || {
            surface::Surface::new_with(&vertices, &triangles, mode, &tell)
        })?;
        Ok(Self(Arc::new(surface)))
    }

    /// Rows of the triangles that were kept; none where all were.
    fn kept<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<u32>>> {
        self.0.kept().map(|kept| PyArray1::from_slice(py, kept))
    }

    /// The same triangles between vertices (n, 3) at other places.
    #[pyo3(signature = (vertices, *, threads=None))]
    fn deform(&self, py: Python<'_>, vertices: PyReadonlyArray2<'_, f64>, threads: Option<usize>) -> PyResult<Self> {
        let vertices = points(numbers("vertices", &vertices, [None, Some(3)])?);
        let surface = compute(py, threads, || self.0.deform(vertices))?;
        Ok(Self(Arc::new(surface)))
    }

    /// What the mesh is good for, if facets that meet below the crease angle [rad] stand for a curved surface, at a
    /// wavelength [m]: numbers of parts, of open, non-manifold and inconsistent edges, of doubled and of thin triangles; area
    /// and smooth area [m^2], largest and mean sagitta [m], largest and rms difference of the echoes of flat facets.
    #[pyo3(signature = (*, crease_angle, wavelength, threads=None))]
    fn quality(
        &self,
        py: Python<'_>,
        crease_angle: f64,
        wavelength: f64,
        threads: Option<usize>,
    ) -> PyResult<([usize; 6], [f64; 6])> {
        let q = compute(py, threads, || Ok(self.0.quality(crease_angle, wavelength)))?;
        let counts = [
            q.num_parts,
            q.num_open_edges,
            q.num_nonmanifold_edges,
            q.num_inconsistent_edges,
            q.num_duplicates,
            q.num_thin,
        ];
        let measures = [
            q.area,
            q.smooth_area,
            q.largest_sagitta,
            q.mean_sagitta,
            q.largest_difference,
            q.rms_difference,
        ];
        Ok((counts, measures))
    }

    /// Memory of triangles, tree and shading, and of the vertices [bytes].
    #[getter]
    fn memory(&self) -> (usize, usize) {
        (self.0.memory(), self.0.vertex_memory())
    }
}

/// Surfaces.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Scene {
    pub(super) surfaces: Vec<Arc<surface::Surface>>,
}

#[pymethods]
impl Scene {
    #[new]
    fn new(surfaces: Vec<PyRef<'_, Surface>>) -> Self {
        Self {
            surfaces: surfaces.iter().map(|s| s.0.clone()).collect(),
        }
    }

    /// Which of `points` (n, 3) in the sensor frame hide behind bodies at `poses` (body, 3, 4), and how many searches ended
    /// at a triangle in the way while there were boxes in front of it: none unless `ends_early`.
    #[pyo3(signature = (poses, points, *, ends_early=true, threads=None))]
    fn hide<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray3<'_, f64>,
        points: PyReadonlyArray2<'_, f64>,
        ends_early: bool,
        threads: Option<usize>,
    ) -> PyResult<(Bound<'py, PyArray1<bool>>, usize)> {
        let poses = self::poses(numbers("poses", &poses, [Some(self.surfaces.len()), Some(3), Some(4)])?);
        let points = self::points(numbers("points", &points, [None, Some(3)])?);
        let hidden = compute(py, threads, || Ok(self.snapshot(&poses).hide(&points, ends_early)))?;
        Ok((hidden.is_hidden.into_pyarray(py), hidden.ended_early))
    }

    /// Cast the rays of an image with the bodies at `poses` (body, 3, 4), body to sensor. `previous` hits of the same scene
    /// are taken over where no body has moved. `beam`, antennas and their least gain of interest there and back relative to
    /// the peaks, and `skip_empty` say which tiles of the image are left out.
    #[pyo3(signature = (
        poses, *, rows, columns, half_width, half_height, previous=None, beam=None, skip_empty=true, with_cosines=false,
        threads=None
    ))]
    fn cast(
        &self,
        py: Python<'_>,
        poses: PyReadonlyArray3<'_, f64>,
        rows: usize,
        columns: usize,
        half_width: f64,
        half_height: f64,
        previous: Option<PyRef<'_, Hits>>,
        beam: Option<(PyRef<'_, Antennas>, f64)>,
        skip_empty: bool,
        with_cosines: bool,
        threads: Option<usize>,
    ) -> PyResult<Hits> {
        let poses = self::poses(numbers("poses", &poses, [Some(self.surfaces.len()), Some(3), Some(4)])?);
        let plane = ImagePlane::centered(rows, columns, half_width, half_height);
        let beam = beam.map(|(antennas, floor)| Beam::new(&antennas.0, floor));
        let previous: Option<&Hits> = previous.as_deref();
        compute(py, threads, || {
            plane.check()?;
            let snapshot = self.snapshot(&poses);
            let [u, v] = plane.ranges();
            let beam = beam.and_then(|beam| beam.in_front(|| snapshot.nearest_in_front(), u, v));
            let is_outside = |u, v| beam.as_ref().is_some_and(|beam| beam.misses(u, v));
            let cast = Cast {
                outside: beam.is_some().then_some(&is_outside),
                skip_empty,
                with_cosines,
                previous: previous
                    .filter(|hits| hits.beam == beam)
                    .map(|hits| (&hits.snapshot, &hits.image)),
                ..Cast::default()
            };
            let image = snapshot.cast_image_with(&plane, &cast)?;
            Ok(Hits {
                snapshot,
                beam,
                image,
                shown: OnceLock::new(),
            })
        })
    }

    /// Cast rays where they are needed with the bodies at `poses` (body, 3, 4), body to sensor: through a base grid of `rows`
    /// x `columns` cells, which are split until they leave open less than `rcs_floor` asks for, as far as `budget` rays go.
    /// `end_points`: cells whose phase turns fast stand for their ends.
    /// What was sampled of the same scene before is taken over where no body has moved. `beam` and `skip_empty` as in `cast`.
    #[pyo3(signature = (
        poses, materials, *, rows, columns, half_width, half_height, antennas, rcs_floor, budget=None, end_points, seed,
        previous=None, beam=None, skip_empty=true, threads=None
    ))]
    fn sample(
        &self,
        py: Python<'_>,
        poses: PyReadonlyArray3<'_, f64>,
        materials: Vec<PyRef<'_, Material>>,
        rows: usize,
        columns: usize,
        half_width: f64,
        half_height: f64,
        antennas: PyRef<'_, Antennas>,
        rcs_floor: f64,
        budget: Option<usize>,
        end_points: bool,
        seed: u64,
        previous: Option<PyRef<'_, Samples>>,
        beam: Option<(PyRef<'_, Antennas>, f64)>,
        skip_empty: bool,
        threads: Option<usize>,
    ) -> PyResult<Samples> {
        let poses = self::poses(numbers("poses", &poses, [Some(self.surfaces.len()), Some(3), Some(4)])?);
        let materials = self::materials(&materials, self.surfaces.len())?;
        let array = &antennas.0;
        let beam = beam.map(|(antennas, floor)| Beam::new(&antennas.0, floor));
        let rule = Rule {
            base: ImagePlane::centered(rows, columns, half_width, half_height),
            rcs_floor,
            budget,
            end_points,
            beam: beam.as_ref(),
        };
        let cast = Cast {
            skip_empty,
            ..Cast::default()
        };
        let before = previous.as_ref().map(|before| (&before.snapshot, &before.samples));
        let (snapshot, samples) = compute(py, threads, || {
            let snapshot = self.snapshot(&poses);
            let samples = samples::Samples::new(&snapshot, &cast, &materials, array, &rule, seed, before)?;
            Ok((snapshot, samples))
        })?;
        Ok(Samples { snapshot, samples })
    }
}

/// Snapshots of a scene.
impl Scene {
    pub(super) fn snapshot(&self, poses: &[Pose]) -> Snapshot {
        Snapshot::new(self.surfaces.clone(), poses.to_vec())
    }
}

pub(super) type ShadedArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>);

/// What the rays of an image hit.
#[pyclass(frozen, module = "radarcore._core")]
pub(super) struct Hits {
    pub(super) snapshot: Snapshot,
    /// Beam that it was cast with; none: all directions.
    pub(super) beam: Option<Beam>,
    pub(super) image: hits::Hits,
    pub(super) shown: OnceLock<Shown>,
}

#[pymethods]
impl Hits {
    /// Distance along the ray [m], (rows, columns); inf where nothing was hit.
    fn distance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.image(PyArray1::from_slice(py, &self.image.distance))
    }

    /// Rays that were cast, and tiles that were skipped and taken over.
    #[getter]
    fn counts(&self) -> (usize, usize, usize) {
        let hits::Counts {
            rays,
            tiles_skipped,
            tiles_reused,
        } = self.image.counts;
        (rays, tiles_skipped, tiles_reused)
    }

    /// Cosine of the angle of incidence, (rows, columns); 0 where nothing was hit.
    #[pyo3(signature = (*, threads=None))]
    fn cos_incidence<'py>(&self, py: Python<'py>, threads: Option<usize>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        check_threads(threads)?;
        if let Some(cosine) = &self.image.cosine {
            return self.image(PyArray1::from_slice(py, cosine));
        }
        let shown = compute(py, threads, || Ok(self.shown()))?;
        self.image(PyArray1::from_slice(py, &shown.cosine))
    }

    /// Distance along the ray to the surface that the facets stand for [m], (rows, columns), and its unit normal
    /// towards the sensor, (rows, columns, 3); inf and 0 where nothing was hit.
    #[pyo3(signature = (*, threads=None))]
    fn shaded<'py>(&self, py: Python<'py>, threads: Option<usize>) -> PyResult<ShadedArrays<'py>> {
        let shown = compute(py, threads, || Ok(self.shown()))?;
        let plane = &self.image.plane;
        let normals = shown.normal.iter().flat_map(DVec3::to_array);
        Ok((
            self.image(PyArray1::from_slice(py, &shown.distance))?,
            PyArray1::from_iter(py, normals).reshape([plane.rows, plane.columns, 3])?,
        ))
    }

    /// Power reflectance of the materials, one per body, at the angles of the pixels, (rows, columns); 0 where nothing was hit.
    #[pyo3(signature = (materials, *, frequency, polarization=None, threads=None))]
    fn reflectance<'py>(
        &self,
        py: Python<'py>,
        materials: Vec<PyRef<'_, Material>>,
        frequency: f64,
        polarization: Option<[f64; 3]>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let materials = self::materials(&materials, self.snapshot.num_bodies())?;
        let polarization = polarization.map(DVec3::from_array);
        let reflectance = compute(py, threads, || {
            let shown = || self.shown();
            Ok(reflectance::reflectance(
                &self.image,
                &materials,
                frequency,
                polarization,
                shown,
            ))
        })?;
        self.image(reflectance.into_pyarray(py))
    }

    /// Number of the body, (rows, columns); -1 where nothing was hit.
    fn body<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i32>>> {
        const { assert!(NO_BODY.cast_signed() == -1) };
        let numbers: Vec<i32> = self.image.body.iter().map(|body| body.cast_signed()).collect();
        self.image(numbers.into_pyarray(py))
    }

    /// The vertices of the triangle that a pixel hit and their weights there; the pixel hit something.
    fn place_on_mesh(&self, pixel: usize) -> PyResult<([u32; 3], [f64; 3])> {
        let body = self.image.body.get(pixel).copied().filter(|body| *body != NO_BODY);
        let body = body.ok_or_else(|| Error::value("pixel", "one that hit something", pixel))?;
        let plane = &self.image.plane;
        let cell = plane.cell(pixel / plane.columns, pixel % plane.columns);
        let triangle = self.image.triangle[pixel];
        Ok(patch::place_on_mesh(&self.snapshot, &cell, body, triangle))
    }

    /// Unit direction of the ray of a pixel in the sensor frame.
    fn direction(&self, pixel: usize) -> PyResult<[f64; 3]> {
        let plane = &self.image.plane;
        if pixel >= plane.num_pixels() {
            let expected = format!("a number below {}", plane.num_pixels());
            return Err(Error::value("pixel", expected, pixel).into());
        }
        Ok(plane.direction(pixel / plane.columns, pixel % plane.columns).to_array())
    }

    /// Unit directions of the rays in the sensor frame, (rows, columns, 3).
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let plane = &self.image.plane;
        let pixels = (0..plane.rows).flat_map(|row| (0..plane.columns).map(move |column| (row, column)));
        let numbers = pixels.flat_map(|(row, column)| plane.direction(row, column).to_array());
        PyArray1::from_iter(py, numbers).reshape([plane.rows, plane.columns, 3])
    }

    /// Material points of all hits that send anything back; `materials` has one per body.
    #[pyo3(signature = (materials, *, antennas, is_footprint, seed, threads=None))]
    fn scatterers(
        &self,
        py: Python<'_>,
        materials: Vec<PyRef<'_, Material>>,
        antennas: PyRef<'_, Antennas>,
        is_footprint: bool,
        seed: u64,
        threads: Option<usize>,
    ) -> PyResult<Scatterers> {
        let materials = self::materials(&materials, self.snapshot.num_bodies())?;
        let array = antennas.0.clone();
        let sampling = sampling(is_footprint);
        let scatterers = compute(py, threads, || {
            Ok(scatterers::Scatterers::new(
                &self.snapshot,
                &self.image,
                self.shown(),
                &materials,
                array,
                sampling,
                seed,
            ))
        })?;
        Ok(Scatterers {
            scatterers,
            num_bodies: self.snapshot.num_bodies(),
        })
    }

    /// Routes of two to `max_bounces` reflections of all hits; `materials` has one per body. Tubes end where their power is
    /// less than `floor` of what was launched.
    #[pyo3(signature = (materials, *, antennas, is_footprint, max_bounces, floor, threads=None))]
    fn bounces(
        &self,
        py: Python<'_>,
        materials: Vec<PyRef<'_, Material>>,
        antennas: PyRef<'_, Antennas>,
        is_footprint: bool,
        max_bounces: usize,
        floor: f64,
        threads: Option<usize>,
    ) -> PyResult<Bounces> {
        let limits = Limits { max_bounces, floor };
        let array = antennas.0.clone();
        let launches = Launch::of_image(&self.image);
        Bounces::new(
            py,
            &self.snapshot,
            &launches,
            materials,
            array,
            is_footprint,
            limits,
            threads,
        )
    }
}

impl Hits {
    /// What the pixels show; computed once.
    pub(super) fn shown(&self) -> &Shown {
        self.shown.get_or_init(|| Shown::new(&self.snapshot, &self.image))
    }

    pub(super) fn image<'py, T: numpy::Element>(
        &self,
        pixels: Bound<'py, PyArray1<T>>,
    ) -> PyResult<Bound<'py, PyArray2<T>>> {
        pixels.reshape([self.image.plane.rows, self.image.plane.columns])
    }
}
