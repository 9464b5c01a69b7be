//! Rays: images of posed bodies, by traversal of a bounding-volume tree and a watertight test of triangles.

pub mod batch;
pub mod build;
pub mod camera;
pub mod facets;
pub mod hits;
pub mod image;
pub mod measure;
pub mod nearest_point;
pub mod packet;
pub mod packet_hits;
pub mod packet_search;
pub mod scene;
pub mod search;
pub mod shade;
pub mod surface;
pub mod traversal;
pub mod tree;
pub mod triangle_block;
pub mod watertight;

#[cfg(test)]
mod tests;
