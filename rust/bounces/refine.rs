//! Cells that launch ray tubes, quartered where neighbours meet other surfaces and over small parts of meshes.

use std::collections::BTreeMap;

use glam::DMat3;
use num_complex::Complex64;
use rayon::prelude::*;

use super::direction::tube_antennas;
use super::launch::{Launch, quarter_centers};
use super::path::{BouncePath, Bounces};
use super::shooting::{CellPaths, Launcher, Limits, TubeCounts, TubeView};
use crate::antennas::array::Array;
use crate::rays::camera::ImagePlane;
use crate::rays::hits::Hits;
use crate::rays::scene::PosedScene;
use crate::scattering::material::Material;
use crate::scattering::mesh_parts::MeshPart;
use crate::scattering::refinement::Sampling;

/// Number of cells across a small part of a mesh.
pub const CELLS_ACROSS: f64 = 8.0;

/// Error of a cell relative to the field of the smallest cross-section of interest: some hundred of cells along the rim
/// of an aperture err at random.
const ERROR: f64 = 0.05;

/// Largest number of times that a cell is quartered.
const DEEPEST: usize = 10;

/// Most tubes of quarters, relative to the pixels of the images, and at least.
const MOST_TUBES: f64 = 0.25;
const LEAST_TUBES: usize = 8_000;

/// Image whose pixels launch ray tubes.
pub struct TubeImage<'a> {
    /// Rotation from the axes of the image to the axes of the sensor.
    pub rotation: DMat3,
    /// Hits of the pixels.
    pub hits: &'a Hits,
    /// Parts of the meshes that may be smaller than the pixels.
    pub parts: Vec<MeshPart>,
}

/// Cell with its paths that may be quartered.
struct TubeCell {
    image: usize,
    center: [f64; 2],
    size: [f64; 2],
    /// Numbers of the small parts in it.
    parts: Vec<usize>,
    paths: CellPaths,
    /// Magnitude of the field by which its parent differs from its quarters [m^2].
    residual: f64,
}

impl Bounces {
    /// Paths of two and more reflections of all pixels of images and of their quarters, and counts; one material per
    /// body. `field`: field of the smallest cross-section of interest [m^2]; an infinite one quarters no pixel.
    pub fn new(
        scene: &PosedScene,
        images: &[TubeImage],
        materials: &[Material],
        array: &Array,
        limits: Limits,
        sampling: Sampling,
        field: f64,
    ) -> (Self, TubeCounts) {
        let view = TubeView::new(images.iter().map(|image| (image.rotation, &image.hits.plane)));
        let num_pixels: usize = images.iter().map(|image| image.hits.plane.num_pixels()).sum();
        let antennas = tube_antennas(array);
        let launcher = Launcher::new(scene, view, materials, &antennas, limits, sampling);
        let mut refine = TubeRefinement {
            scene,
            images,
            launcher,
            num_channels: antennas.num_channels(),
            error: ERROR * field / (4.0 * std::f64::consts::PI),
            tubes: LEAST_TUBES.max((MOST_TUBES * num_pixels as f64) as usize),
            paths: Vec::new(),
            counts: TubeCounts::default(),
        };
        let mut cells: Vec<TubeCell> = (0..images.len()).flat_map(|image| refine.pixels(image)).collect();
        for _ in 0..DEEPEST {
            cells = refine.quartered(cells);
        }
        for cell in cells {
            refine.keep_coarse(cell);
        }
        let TubeRefinement { paths, counts, .. } = refine;
        (Self::of_paths(array.clone(), antennas, paths), counts)
    }
}

struct TubeRefinement<'a> {
    scene: &'a PosedScene,
    images: &'a [TubeImage<'a>],
    launcher: Launcher<'a>,
    /// Number of pairs of antennas of tubes.
    num_channels: usize,
    /// Largest error of a cell [m^2].
    error: f64,
    /// Number of tubes that may still be launched.
    tubes: usize,
    /// Paths of cells that are not quartered.
    paths: Vec<BouncePath>,
    counts: TubeCounts,
}

impl TubeRefinement<'_> {
    /// Keep the paths of a cell that is not quartered.
    fn keep(&mut self, cell: CellPaths) {
        self.counts.power += largest(&cell.fields).powi(2);
        self.paths.extend(cell.paths);
    }

    /// Keep the paths of a cell for whose quarters there are no tubes.
    fn keep_coarse(&mut self, cell: TubeCell) {
        self.counts.coarse += 1;
        self.counts.error_power += cell.residual.powi(2);
        self.keep(cell.paths);
    }

    /// Pixels of an image that may be quartered; the paths of all others are kept.
    fn pixels(&mut self, number: usize) -> Vec<TubeCell> {
        let TubeImage { rotation, hits, parts } = &self.images[number];
        let plane = &hits.plane;
        let shoot = |pixel: usize| {
            let launch = Launch::of_pixel(hits, *rotation, pixel);
            launch.map_or_else(
                || CellPaths::empty(self.num_channels),
                |launch| self.launcher.shoot(&launch),
            )
        };
        let found: Vec<CellPaths> = (0..plane.num_pixels()).into_par_iter().map(shoot).collect();
        let strengths: Vec<f64> = found.iter().map(|paths| largest(&paths.fields)).collect();
        let surfaces: Vec<u64> = found.iter().map(|paths| paths.surfaces).collect();
        let parts = parts_by_pixel(plane, parts);
        let mut cells = Vec::new();
        for (pixel, paths) in found.into_iter().enumerate() {
            self.counts = self.counts.plus(paths.counts);
            let (mut strongest, mut is_edge) = (0.0_f64, false);
            for beside in neighbours(plane, pixel) {
                strongest = strongest.max(strengths[beside]);
                is_edge |= surfaces[beside] != surfaces[pixel];
            }
            let parts = parts.get(&pixel).cloned().unwrap_or_default();
            if parts.is_empty() && !(is_edge && strongest > self.error) {
                self.keep(paths);
                continue;
            }
            let (u, v) = plane.center(pixel / plane.columns, pixel % plane.columns);
            cells.push(TubeCell {
                image: number,
                center: [u, v],
                size: [plane.du, plane.dv],
                parts,
                paths,
                residual: strongest,
            });
        }
        cells
    }

    /// Quarters of the cells that have other fields or small parts; the paths of all others are kept.
    fn quartered(&mut self, mut cells: Vec<TubeCell>) -> Vec<TubeCell> {
        // Where tubes run out, the largest residuals come first.
        let most = self.tubes / 4;
        if cells.len() > most {
            cells.sort_by(|a, b| b.residual.total_cmp(&a.residual));
            for cell in cells.split_off(most) {
                self.keep_coarse(cell);
            }
        }
        self.tubes -= 4 * cells.len();
        let quarters: Vec<[TubeCell; 4]> = cells.par_iter().map(|cell| self.quarters(cell)).collect();
        let mut next = Vec::new();
        for (cell, mut quarters) in cells.into_iter().zip(quarters) {
            for quarter in &quarters {
                self.counts = self.counts.plus(quarter.paths.counts);
            }
            let differences: Vec<Complex64> = (0..cell.paths.fields.len())
                .map(|channel| {
                    let parts = quarters.iter().map(|quarter| quarter.paths.fields[channel]);
                    parts.sum::<Complex64>() - cell.paths.fields[channel]
                })
                .collect();
            let residual = largest(&differences);
            if residual > self.error || !cell.parts.is_empty() {
                for quarter in &mut quarters {
                    quarter.residual = residual;
                }
                next.extend(quarters);
            } else {
                self.keep(cell.paths);
            }
        }
        next
    }

    fn quarters(&self, cell: &TubeCell) -> [TubeCell; 4] {
        let TubeImage { rotation, parts, .. } = &self.images[cell.image];
        let size = cell.size.map(|size| 0.5 * size);
        quarter_centers(cell.center, cell.size).map(|center| {
            let launch = Launch::at(self.scene, *rotation, center, size);
            let is_small = |part: &&usize| is_small(&parts[**part], center, size);
            TubeCell {
                image: cell.image,
                center,
                size,
                parts: cell.parts.iter().filter(is_small).copied().collect(),
                paths: launch.map_or_else(
                    || CellPaths::empty(self.num_channels),
                    |launch| self.launcher.shoot(&launch),
                ),
                residual: 0.0,
            }
        })
    }
}

/// Largest magnitude.
fn largest(fields: &[Complex64]) -> f64 {
    fields.iter().map(|field| field.norm()).fold(0.0, f64::max)
}

/// True if a cell shows some of a part, and is too wide for it.
fn is_small(part: &MeshPart, center: [f64; 2], size: [f64; 2]) -> bool {
    let shows = |axis: usize, [low, high]: [f64; 2]| {
        (center[axis] - 0.5 * (low + high)).abs() < 0.5 * (high - low + size[axis])
    };
    (size[0] > part.width[0] || size[1] > part.width[1]) && shows(0, part.u) && shows(1, part.v)
}

/// Numbers of the small parts of every pixel that shows some.
fn parts_by_pixel(plane: &ImagePlane, parts: &[MeshPart]) -> BTreeMap<usize, Vec<usize>> {
    let mut by_pixel = BTreeMap::<usize, Vec<usize>>::new();
    for (number, part) in parts.iter().enumerate() {
        let [rows, columns] = plane.pixels_of(part.u, part.v);
        for row in rows {
            for column in columns.clone() {
                by_pixel.entry(row * plane.columns + column).or_default().push(number);
            }
        }
    }
    by_pixel
}

/// A pixel and its neighbours.
fn neighbours(plane: &ImagePlane, pixel: usize) -> impl Iterator<Item = usize> {
    let (row, column, columns) = (pixel / plane.columns, pixel % plane.columns, plane.columns);
    let rows = row.saturating_sub(1)..(row + 2).min(plane.rows);
    rows.flat_map(move |row| {
        (column.saturating_sub(1)..(column + 2).min(columns)).map(move |column| row * columns + column)
    })
}
