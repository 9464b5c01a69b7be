//! Rays: images of posed bodies, by traversal of a bounding-volume tree and a watertight test of triangles.

pub mod build;
pub mod camera;
pub mod hits;
pub mod image;
pub mod nearest_point;
pub mod packet;
pub mod packet_hits;
pub mod packet_search;
pub mod pyramid;
pub mod scene;
pub mod search;
pub mod single_ray;
pub mod surface;
pub mod tile_hits;
pub mod traversal;
pub mod tree;
pub mod triangle_block;
pub mod visibility;
pub mod watertight;

#[cfg(test)]
pub mod tests;
