//! Model of a simulation: bodies or an image, materials, radar and settings, all independent of the motion.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat3, DVec3};

use crate::antennas::array::Array;
use crate::antennas::beam::Beam;
use crate::bounces::Limits;
use crate::cancel::Cancel;
use crate::constants::SPEED_OF_LIGHT;
use crate::error::{Error, Result, fits_memory};
use crate::geometry::pose::Pose;
use crate::numeric::simd::Level;
use crate::paths::kinematics::{Kinematics, World};
use crate::rays::camera::ImagePlane;
use crate::rays::scene::PosedScene;
use crate::rays::surface::{ShadingMode, Surface};
use crate::scattering::material::Material;
use crate::scattering::refinement::{Refinement, Sampling};
use crate::scattering::reflection_table::Reflection;
use crate::scattering::surface_image::SurfaceImage;
use crate::synthesis::beat_signal::is_worth_threads;
use crate::synthesis::chirp::Waveform;
use crate::synthesis::choose::Method;
use crate::synthesis::report::{Known, Options};

/// Largest phase of joined points from their mean [rad] times the bandwidth over the carrier frequency, and the least
/// and the largest such phase: the sum over the band then changes by a few percent.
const JOIN_OVER_BAND: f64 = 0.12;
const LEAST_JOIN: f64 = 1.0;
const MOST_JOIN: f64 = 2.5;

/// Bodies with surfaces, and point targets.
#[derive(Clone, Default)]
pub struct Scene {
    /// Surface of every body, as its mesh was given.
    pub surfaces: Vec<Arc<Surface>>,
    /// Bodies whose vertices move, increasing.
    pub deforming: Vec<usize>,
    /// Radar cross-sections of the point targets [m^2].
    pub rcs: Vec<f64>,
    /// Numbers of the bodies with surfaces and of the point targets in the scene.
    pub body_numbers: Vec<usize>,
    /// Numbers of the point targets, see `body_numbers`.
    pub point_numbers: Vec<usize>,
}

/// Origin of the surfaces that the sensor sees.
pub enum Source {
    /// Meshes and points.
    Scene(Scene),
    /// An image.
    Depth(Arc<SurfaceImage>),
}

impl Source {
    /// Numbers of the bodies that deform.
    pub(super) fn deforming(&self) -> &[usize] {
        match self {
            Self::Scene(scene) => &scene.deforming,
            Self::Depth(_) => &[],
        }
    }

    /// Radar cross-sections of the point targets [m^2].
    pub(super) fn rcs(&self) -> &[f64] {
        match self {
            Self::Scene(scene) => &scene.rcs,
            Self::Depth(_) => &[],
        }
    }
}

/// Rays of frames.
#[derive(Clone, Debug)]
pub struct RaySampling {
    /// Image planes of the sectors of the field of view, see [`Settings::rotations`]: pixels, or the coarsest cells.
    pub planes: Vec<ImagePlane>,
    /// Sampling of the surface behind a pixel or cell.
    pub sampling: Sampling,
    /// Settings of the refinement of cells; none: pixels are not split.
    pub refinement: Option<Refinement>,
}

/// Switches of tests and benches, which change no result.
#[derive(Clone, Copy, Debug)]
pub struct Switches {
    /// True if tiles without bodies are skipped.
    pub skip_empty: bool,
    /// True if static tiles are reused from the frame before.
    pub reuse_tiles: bool,
    /// Instruction set of rays and sums.
    pub level: Level,
}

impl Default for Switches {
    fn default() -> Self {
        Self {
            skip_empty: true,
            reuse_tiles: true,
            level: Level::best(),
        }
    }
}

/// Settings of the simulation.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Sectors of the field of view: rotations from the axes of the sensor to the axes of image planes. The first looks
    /// where the sensor does, in its axes.
    pub rotations: Vec<DMat3>,
    /// Rays of frames.
    pub rays: RaySampling,
    /// Pixels that launch ray tubes, of every sector.
    pub tubes: Vec<ImagePlane>,
    /// Pixels of images.
    pub image: ImagePlane,
    /// Least gain of interest of a pair of antennas relative to their peaks, there and back; none: all directions are
    /// cast.
    pub gain_floor: Option<f64>,
    /// Switches of tests and benches.
    pub debug: Switches,
    /// Largest number of reflections, and the power at which ray tubes end.
    pub limits: Limits,
    /// Largest angle by which bodies may turn from a cast on [rad]; may be infinite.
    pub retrace: f64,
    /// Seed of speckle.
    pub seed: u64,
    /// Bound on the error of the sum, see [`Options`].
    pub tolerance: f64,
    /// Method of the sum.
    pub method: Method,
}

/// Antennas in the axes of a sector of the field of view, and what follows from them.
pub struct Facing {
    /// Rotation from the axes of the sensor.
    pub rotation: DMat3,
    /// Antennas.
    pub array: Array,
    /// Directions that the antennas see; none: all.
    pub beam: Option<Beam>,
    /// Tables of the reflection coefficients of the materials at the centre of the band.
    pub reflections: Vec<Reflection>,
}

impl Facing {
    /// An array in turned axes; `gain_floor`: see [`Settings`].
    fn new(array: &Array, rotation: DMat3, gain_floor: Option<f64>, materials: &[Material]) -> Self {
        let array = if rotation == DMat3::IDENTITY {
            array.clone()
        } else {
            array.turned(&rotation)
        };
        let wavelength = SPEED_OF_LIGHT / array.frequency;
        let table = |material| Reflection::new(material, wavelength, array.polarization);
        Self {
            beam: gain_floor.map(|floor| Beam::new(&array, floor)),
            reflections: materials.iter().map(table).collect(),
            rotation,
            array,
        }
    }

    /// Directions in front of the sensor that the antennas see of a scene in the axes of the sector; none: all.
    pub fn beam_over(&self, scene: &PosedScene, plane: &ImagePlane) -> Option<Beam> {
        let [u, v] = plane.ranges();
        let beam = self.beam.as_ref()?;
        beam.in_front(|| scene.nearest_in_front(), u, v)
    }

    /// A scene in the axes of the sector.
    pub fn scene(&self, scene: &Arc<PosedScene>) -> Arc<PosedScene> {
        if self.rotation == DMat3::IDENTITY {
            scene.clone()
        } else {
            Arc::new(scene.turned(&self.rotation))
        }
    }
}

/// A simulation without its motion.
pub struct Model {
    /// Surfaces.
    pub source: Source,
    /// Material of every body with a surface.
    pub materials: Vec<Material>,
    /// Antennas.
    pub array: Array,
    /// Waveform.
    pub waveform: Waveform,
    /// Middle of the array in sensor axes [m].
    pub center: DVec3,
    /// Settings.
    pub settings: Settings,
    /// Antennas in the axes of every sector.
    pub(super) sectors: Vec<Facing>,
    /// Largest distance of a vertex from the origin of its body [m].
    pub(super) radii: Vec<f64>,
    /// Smallest and largest coordinates of the vertices of every body [m].
    pub(super) boxes: Vec<[DVec3; 2]>,
}

impl Model {
    /// Build a model; an error for materials that do not fit the bodies.
    pub fn new(
        source: Source,
        materials: Vec<Material>,
        array: Array,
        waveform: Waveform,
        center: DVec3,
        settings: Settings,
    ) -> Result<Self> {
        let (radii, boxes) = match &source {
            Source::Scene(scene) => {
                if materials.len() != scene.surfaces.len() {
                    let expected = format!("{}, one per body", scene.surfaces.len());
                    return Err(Error::value("materials", expected, materials.len()));
                }
                let radius = |surface: &Arc<Surface>| {
                    let vertices = surface.vertices().iter();
                    vertices.map(|vertex| vertex.length()).fold(0.0, f64::max)
                };
                let corners = |surface: &Arc<Surface>| {
                    let vertices = surface.vertices().iter();
                    vertices.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], vertex| {
                        [low.min(*vertex), high.max(*vertex)]
                    })
                };
                let surfaces = scene.surfaces.iter();
                (surfaces.clone().map(radius).collect(), surfaces.map(corners).collect())
            }
            Source::Depth(image) => {
                fits_memory("bodies", &[image.num_bodies], size_of::<Pose>())?;
                let distances = image.distance.iter().copied();
                let farthest = distances.filter(|distance| distance.is_finite()).fold(0.0, f64::max);
                (vec![farthest; image.num_bodies], Vec::new())
            }
        };
        let facing = |rotation: &DMat3| Facing::new(&array, *rotation, settings.gain_floor, &materials);
        Ok(Self {
            sectors: settings.rotations.iter().map(facing).collect(),
            radii,
            boxes,
            source,
            materials,
            array,
            waveform,
            center,
            settings,
        })
    }

    /// Largest difference of the phases of joined points from their mean [rad]: joined points err over the band.
    pub(super) fn join(&self) -> f64 {
        let waveform = &self.waveform;
        let bandwidth = waveform.slope.abs() * waveform.num_samples as f64 / waveform.sample_rate;
        (JOIN_OVER_BAND * self.array.frequency / bandwidth).clamp(LEAST_JOIN, MOST_JOIN)
    }

    /// Motion in the sensor frame.
    pub(super) fn motion(&self, world: &World) -> Result<Kinematics> {
        self.check(world)?;
        Ok(world.seen(self.center, self.source.deforming()))
    }

    /// Time derivatives in the sensor frame, of the motion `at` one time, its first.
    pub(super) fn rates(&self, at: &World, rates: &World) -> Result<Kinematics> {
        self.check(rates)?;
        Ok(World::seen_rates(at, rates, self.center, self.source.deforming()))
    }

    fn check(&self, world: &World) -> Result<()> {
        match &self.source {
            Source::Scene(scene) => {
                let deforming = scene.deforming.iter();
                let num_vertices: Vec<usize> = deforming.map(|body| scene.surfaces[*body].vertices().len()).collect();
                world.check(scene.surfaces.len(), scene.rcs.len(), &num_vertices)
            }
            Source::Depth(image) => world.check(image.num_bodies, 0, &[]),
        }
    }

    /// Error of phases by the series of the motion [rad].
    pub(super) fn phase_error(&self, motion: &Kinematics) -> f64 {
        self.phase_per_length() * motion.tail(&self.radii)
    }

    /// Phase of an echo by the distance to its scatterer [rad/m], at most.
    pub(super) fn phase_per_length(&self) -> f64 {
        2.0 * std::f64::consts::TAU * self.highest_frequency() / SPEED_OF_LIGHT
    }

    /// Bodies at the time `x` of the frame, deforming ones with the vertices of that time; their surfaces replace
    /// `deformed`, the surfaces of the frame before, unless the vertices are equal.
    pub(super) fn posed(
        &self,
        motion: &Kinematics,
        x: f64,
        deformed: &mut HashMap<usize, Arc<Surface>>,
    ) -> Result<Arc<PosedScene>> {
        let scene = match &self.source {
            Source::Scene(scene) => scene,
            // The pixels are given in the sensor frame.
            Source::Depth(image) => {
                let empty = Arc::new(Surface::new(&[], &[], ShadingMode::Flat, &Cancel::default())?);
                let surfaces = vec![empty; image.num_bodies];
                return Ok(Arc::new(PosedScene::new(
                    surfaces,
                    vec![Pose::IDENTITY; image.num_bodies],
                )));
            }
        };
        let mut surfaces = scene.surfaces.clone();
        for (body, vertices) in &motion.vertices {
            let (vertices, before) = (vertices.at(x), deformed.get(body));
            surfaces[*body] = match before {
                Some(before) if before.vertices() == vertices => before.clone(),
                _ => Arc::new(
                    before
                        .unwrap_or(&surfaces[*body])
                        .deform(vertices, &Cancel::default())?,
                ),
            };
            deformed.insert(*body, surfaces[*body].clone());
        }
        Ok(Arc::new(PosedScene::new(surfaces, motion.poses.at(x))))
    }

    /// Highest frequency of the sampled band [Hz].
    pub(super) fn highest_frequency(&self) -> f64 {
        let waveform = &self.waveform;
        let half = 0.5 * waveform.slope.abs() * waveform.num_samples as f64 / waveform.sample_rate;
        waveform.start_frequency.max(waveform.center_frequency()) + half
    }

    /// Shape of the samples of a frame, `(channel, chirp, sample)`.
    pub fn shape(&self) -> [usize; 3] {
        let waveform = &self.waveform;
        [
            self.array.num_channels(),
            waveform.chirp_times.len(),
            waveform.num_samples,
        ]
    }

    /// Options of the sum over `num_paths` paths.
    pub(super) fn options<'a>(&self, num_paths: usize, num_chirps: usize, cancel: &'a Cancel) -> Options<'a> {
        let work = [
            num_paths,
            self.array.num_channels(),
            num_chirps,
            self.waveform.num_samples,
        ];
        Options {
            tolerance: self.settings.tolerance,
            level: self.settings.debug.level,
            is_parallel: rayon::current_num_threads() > 1 && is_worth_threads(work),
            cancel: Some(cancel),
            known: Known::NOTHING,
        }
    }
}
