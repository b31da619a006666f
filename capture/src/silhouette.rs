//! Silhouettes found in the photographs.

use crate::{Aabb, Camera, Image};

/// Finds the matte of the object in every image.
pub fn find_mattes(images: &[Image<[u8; 3]>], cameras: &[Camera]) -> Vec<Image<u8>> {
    find_mattes_in_box(images, cameras, None)
}

/// As [`find_mattes`], where the object's box is known.
pub fn find_mattes_in_box(images: &[Image<[u8; 3]>], cameras: &[Camera], object_box: Option<&Aabb>) -> Vec<Image<u8>> {
    let _ = (cameras, object_box);
    images.iter().map(|image| image.map(|p| if p.into_iter().max() > Some(40) { 255 } else { 0 })).collect()
}
