//! Scattering: scatterers from the surfaces that rays hit, with an amplitude for every pair of antennas.

pub mod lambert;
pub mod material;
pub mod material_frame;
pub mod mesh_parts;
pub mod refinement;
pub mod reflectance;
pub mod reflection_table;
pub mod samples;
pub mod sampling;
pub mod scatterers;
pub mod sector;
pub mod surface_image;
pub mod taper;
pub mod tile_point;
