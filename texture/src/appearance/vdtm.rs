//! View-dependent texture mapping: a few source photographs, blended by closeness of direction.
//!
//! Sources are spread over the views by farthest points. Each becomes a layer; a facet blends the
//! layers of the up to three sources around the eye's direction with the weights of
//! [`crate::directions`]. Where a source does not see a texel its layer holds what the nearest
//! sources that do see it show, so that a hidden source hands its weight on.
//! Source: Debevec, Taylor, Malik 1996; Debevec, Yu, Borshukov 1998; as the baseline of Jagersand, Birkbeck,
//! Cobzas, section 6, with 20 sources. Layers are resampled into the atlas like those of DynTex, for
//! equal footing. Bytes: one photograph's worth of texels per source.

use crate::appearance::static_texture::base_layer;
use crate::bake::Bake;
use crate::complete::{Completed, complete};
use crate::directions::{DirectionComplex, angle, merge_directions};
use crate::layers::{FacetWeights, Layers};
use crate::model::FitOptions;
use crate::observe::{Observation, Samples};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// Fits the layers; also counts texels that no source saw.
pub(crate) fn fit(bake: &Bake<'_>, options: &FitOptions) -> Option<(Layers, usize)> {
    let sources = spread_sources(bake, options.layers);
    let completed: Vec<Completed> =
        (0..bake.facets.texels.len()).into_par_iter().map(|f| complete_facet(bake, f, &sources)).collect();
    let unseen = completed.iter().flat_map(|c| &c.seen).filter(|&&s| !s).count();
    let layers = (0..sources.len())
        .map(|s| base_layer(&source_image(bake, &completed, s), options))
        .collect::<Option<Vec<_>>>()?;
    let facets = completed.iter().enumerate().map(|(f, c)| weights(bake, f, c, &sources)).collect();
    Some((Layers { layers, facet_of_texel: bake.facet_of_texel(), facets }, unseen))
}

/// Up to `count` views, spread over directions by farthest points, in ascending order.
fn spread_sources(bake: &Bake<'_>, count: usize) -> Vec<usize> {
    let center = bake.mesh.mesh.aabb().map_or_else(Point3::origin, |b| b.center());
    let directions: Vec<Vector3<f64>> =
        bake.observers.iter().map(|o| (o.center() - center).try_normalize(1e-300).unwrap_or_else(Vector3::z)).collect();
    let mut chosen = vec![0];
    let mut distance: Vec<f64> = directions.iter().map(|d| angle(d, &directions[0])).collect();
    while chosen.len() < count.min(directions.len()) {
        let far = (0..directions.len()).fold(0, |best, j| if distance[j] > distance[best] { j } else { best });
        chosen.push(far);
        distance.iter_mut().zip(&directions).for_each(|(a, d)| *a = a.min(angle(d, &directions[far])));
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}

fn complete_facet(bake: &Bake<'_>, facet: usize, sources: &[usize]) -> Completed {
    let all = bake.samples(facet);
    let rows: Vec<Observation> = (0..bake.facets.texels[facet].len())
        .flat_map(|i| sources.iter().map(|&j| all.row(i)[j]).collect::<Vec<_>>())
        .collect();
    let directions: Vec<Vector3<f64>> = pick(&bake.directions(facet), sources);
    complete(&Samples { views: sources.len(), rows }, &directions)
}

fn pick(directions: &[Vector3<f64>], sources: &[usize]) -> Vec<Vector3<f64>> {
    sources.iter().map(|&j| directions[j]).collect()
}

/// The atlas as source `s` shows it.
fn source_image(bake: &Bake<'_>, completed: &[Completed], s: usize) -> capture::Image<[f32; 3]> {
    let (values, known): (Vec<_>, Vec<_>) = completed
        .iter()
        .map(|c| match c.views.iter().position(|&v| v == s) {
            Some(k) => (c.colors.chunks_exact(c.views.len()).map(|row| row[k]).collect(), c.seen.clone()),
            None => (vec![[0.0; 3]; c.seen.len()], vec![false; c.seen.len()]),
        })
        .unzip();
    bake.paint(&values, &known)
}

fn weights(bake: &Bake<'_>, facet: usize, completed: &Completed, sources: &[usize]) -> FacetWeights {
    let directions = pick(&pick(&bake.directions(facet), sources), &completed.views);
    let groups = merge_directions(&directions);
    let sites: Vec<Vector3<f64>> = groups.iter().map(|g| directions[g[0]]).collect();
    let rank = sources.len();
    let mut table = vec![0.0; sites.len() * rank];
    for (site, group) in groups.iter().enumerate() {
        group.iter().for_each(|&k| table[site * rank + completed.views[k]] = 1.0 / group.len() as f32);
    }
    FacetWeights {
        center: bake.facets.centers[facet],
        complex: DirectionComplex::build(&sites, bake.layout),
        rank,
        table,
    }
}
