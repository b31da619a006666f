//! What all four appearances are fitted from: photographs asked about the texels of one mesh.

use crate::TextureError;
use crate::directions::{Layout, layout};
use crate::facets::{Facets, partition};
use crate::layers::spread_labels;
use crate::model::FitOptions;
use crate::observe::{Observer, Samples};
use crate::surface::{SurfaceTexels, is_atlas_size};
use capture::{Image, View};
use geometry::TexturedMesh;
use geometry::atlas::PushPull;
use nalgebra::{Point3, Vector3};

/// A mesh, its texels, its facets, and the photographs that see them.
#[derive(Debug)]
pub struct Bake<'a> {
    /// The proxy.
    pub mesh: &'a TexturedMesh,
    /// The surface behind its texels.
    pub surface: SurfaceTexels,
    /// The parts with a basis of their own.
    pub facets: Facets,
    pub(crate) observers: Vec<Observer<'a>>,
    pub(crate) layout: Layout,
}

impl<'a> Bake<'a> {
    /// Prepares `views` and the texels of `mesh`.
    ///
    /// # Errors
    /// Where there is no view or no texel, or more texels, views or facets than a model can number.
    pub fn new(views: &'a [View], mesh: &'a TexturedMesh, options: &FitOptions) -> Result<Self, TextureError> {
        refuse_too_much(views.len(), mesh.atlas_size)?;
        let surface = SurfaceTexels::bake(mesh);
        if views.is_empty() || surface.is_empty() {
            return Err(TextureError::Degenerate {
                fault: format!("{} views and {} texels leave nothing to fit", views.len(), surface.len()),
                remedy: "give at least one view and a mesh with an atlas".to_owned(),
            });
        }
        let facets = partition(mesh, &surface, options.facet_texels);
        if facets.texels.len() > usize::from(u16::MAX) {
            return Err(TextureError::Degenerate {
                fault: format!("{} facets are more than the 65535 a model can number", facets.texels.len()),
                remedy: "use larger facets or a simpler mesh".to_owned(),
            });
        }
        let observers = Observer::prepare(views, &mesh.mesh, options.mask_erode_px);
        let center = mesh.mesh.aabb().map_or_else(Point3::origin, |b| b.center());
        let layout = layout(&directions_from(&center, &observers));
        Ok(Self { mesh, surface, facets, observers, layout })
    }

    /// Observations of a facet's texels in all views.
    pub(crate) fn samples(&self, facet: usize) -> Samples {
        Samples::gather(&self.observers, &self.surface, &self.facets.texels[facet])
    }

    /// Unit directions from a facet's centre to each view.
    pub(crate) fn directions(&self, facet: usize) -> Vec<Vector3<f64>> {
        directions_from(&self.facets.centers[facet], &self.observers)
    }

    /// The facet of every texel of the atlas, gutters included.
    pub(crate) fn facet_of_texel(&self) -> Image<u16> {
        let labels: Vec<u16> = self.surface.faces.iter().map(|&f| self.facets.of_face[f as usize] as u16).collect();
        spread_labels(self.surface.size, &self.surface.index, &labels)
    }

    /// An atlas with `values` (one per facet, one per its texels) where `known`, and smooth elsewhere.
    pub(crate) fn paint(&self, values: &[Vec<[f32; 3]>], known: &[Vec<bool>]) -> Image<[f32; 3]> {
        let [width, height] = self.surface.size;
        let mut image = Image::filled(width, height, [0.0f32; 3]);
        let mut mask = vec![false; width * height];
        for ((texels, values), known) in self.facets.texels.iter().zip(values).zip(known) {
            for ((&t, value), _) in texels.iter().zip(values).zip(known).filter(|(_, known)| **known) {
                let at = self.surface.index[t as usize] as usize;
                image.pixels_mut()[at] = *value;
                mask[at] = true;
            }
        }
        PushPull::new([width, height], &mask).apply(image.pixels_mut().as_flattened_mut(), 3);
        image
    }

    /// The values that an atlas image holds at the texels of a facet.
    pub(crate) fn texels_of(&self, facet: usize, image: &Image<[f32; 3]>) -> Vec<[f32; 3]> {
        let at = |&t: &u32| image.pixels()[self.surface.index[t as usize] as usize];
        self.facets.texels[facet].iter().map(at).collect()
    }
}

/// What a model numbers with 16 bits, 65535 meaning none, and what fits in memory.
fn refuse_too_much(views: usize, atlas_size: [usize; 2]) -> Result<(), TextureError> {
    let refuse = |fault, remedy: &str| Err(TextureError::Degenerate { fault, remedy: remedy.to_owned() });
    if views > usize::from(u16::MAX) {
        return refuse(format!("{views} views are more than the 65535 a model can number"), "use fewer views");
    }
    if !is_atlas_size(atlas_size) {
        return refuse(
            format!("an atlas of {atlas_size:?} texels is more than a model can hold"),
            "use coarser texels",
        );
    }
    Ok(())
}

fn directions_from(center: &Point3<f64>, observers: &[Observer<'_>]) -> Vec<Vector3<f64>> {
    observers.iter().map(|o| (o.center() - center).try_normalize(1e-300).unwrap_or_else(Vector3::z)).collect()
}
