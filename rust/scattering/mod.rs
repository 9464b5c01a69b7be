//! Scattering: scatterers from the surfaces that rays hit, with an amplitude for every pair of antennas.

pub mod depth_image;
pub mod gather;
pub mod lambert;
pub mod material;
pub mod material_frame;
pub mod material_points;
pub mod mesh_parts;
pub mod patch;
pub mod physical_optics;
pub mod refinement;
pub mod reflectance;
pub mod reflection_table;
pub mod samples;
pub mod sampling;
pub mod sector;
pub mod taper;
pub mod tile_point;
