//! DynTex: a linear texture basis per facet.
//!
//! `T(v) = μ + Σ_{k=1..r} y_k(v) B_k`. For a facet of p texels seen in m views, D (3p × m) holds the
//! completed, mean-free textures; `D = U Σ Vᵀ`; the layers are `B = U Σ / √m`, the coefficients
//! `y = √m V`, of unit RMS. Singular vectors come from the m × m Gram matrix in `f64`: squaring the
//! condition number is harmless here, for 8-bit data has a noise floor of 1/√12 level, far above
//! √ε σ₁. Components that move a texel by less than `tolerance` levels RMS are left out, so a facet
//! holds what its surface needs: none where it is matt and its shape right, up to `layers − 1` else.
//! After the layers are coded, the coefficients are fitted again, by least squares, to the layers as
//! they will be decoded. Coefficients are interpolated over directions by [`crate::directions`].
//!
//! Source: Jagersand, Birkbeck, Cobzas, sections 3–5. Layers are counted with the mean.
//! Cost: 3p m² / 2 multiply-adds a facet for the Gram matrix. Limits: a highlight that moves more than its
//! own width between neighbouring views is cross-faded.

use crate::appearance::static_texture::base_layer;
use crate::bake::Bake;
use crate::coding;
use crate::complete::{Completed, complete};
use crate::directions::{DirectionComplex, merge_directions};
use crate::layers::{FacetWeights, Layer, Layers};
use crate::model::FitOptions;
use capture::Image;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

/// Singular values below this share of the largest are rounding of the Gram matrix.
const GRAM_FLOOR: f64 = 1e-7;

/// Share of a layer's texels that may be clipped so that one outlier does not stretch its scale.
const CLIPPED: f64 = 2e-4;

/// Mean and basis of one facet.
struct Basis {
    mean: Vec<[f32; 3]>,
    seen: Vec<bool>,
    /// One entry per component, strongest first; each has the facet's texels.
    layers: Vec<Vec<[f32; 3]>>,
}

/// Fits the basis; also counts texels that no view saw.
pub(crate) fn fit(bake: &Bake<'_>, options: &FitOptions) -> Option<(Layers, usize)> {
    let count = bake.facets.texels.len();
    let bases: Vec<Basis> = (0..count).into_par_iter().map(|f| facet_basis(bake, f, options)).collect();
    let unseen = bases.iter().flat_map(|b| &b.seen).filter(|&&s| !s).count();
    let mut layers = vec![mean_layer(bake, &bases, options)?];
    let most = bases.iter().map(|b| b.layers.len()).max().unwrap_or(0);
    for k in 0..most {
        layers.push(basis_layer(bake, &bases, k, options)?);
    }
    let decoded: Vec<Image<[f32; 3]>> =
        layers.iter().map(|l| l.texels.map(|t| t.map(|v| l.offset + l.scale * f32::from(v)))).collect();
    let facets =
        (0..count).into_par_iter().map(|f| facet_weights(bake, f, 1 + bases[f].layers.len(), &decoded)).collect();
    Some((Layers { layers, facet_of_texel: bake.facet_of_texel(), facets }, unseen))
}

fn facet_basis(bake: &Bake<'_>, facet: usize, options: &FitOptions) -> Basis {
    let completed = complete(&bake.samples(facet), &bake.directions(facet));
    let views = completed.views.len();
    let mean: Vec<[f32; 3]> = row_means(&completed);
    let data = centred(&completed, &mean);
    let layers = components(&data, options.layers.saturating_sub(1).min(views.saturating_sub(1)), options.tolerance);
    Basis { mean, seen: completed.seen, layers }
}

fn row_means(completed: &Completed) -> Vec<[f32; 3]> {
    let views = completed.views.len();
    if views == 0 {
        return vec![[0.0; 3]; completed.seen.len()];
    }
    let mean = |row: &[[f32; 3]]| std::array::from_fn(|c| row.iter().map(|p| p[c]).sum::<f32>() / views as f32);
    completed.colors.chunks_exact(views).map(mean).collect()
}

/// Mean-free data, views × (3 · texels).
fn centred(completed: &Completed, mean: &[[f32; 3]]) -> DMatrix<f64> {
    let views = completed.views.len();
    DMatrix::from_fn(views, 3 * mean.len(), |j, row| {
        let (i, c) = (row / 3, row % 3);
        f64::from(completed.colors[i * views + j][c] - mean[i][c])
    })
}

/// Up to `most` layers `U Σ / √m` of views × values `data`, each moving a value by at least `tolerance` RMS.
fn components(data: &DMatrix<f64>, most: usize, tolerance: f64) -> Vec<Vec<[f32; 3]>> {
    let (views, values) = data.shape();
    if views == 0 || values == 0 || most == 0 {
        return Vec::new();
    }
    let gram = data * data.transpose();
    let Some(eigen) = SymmetricEigen::try_new(gram, 1e-14, 10_000) else { return Vec::new() };
    let mut order: Vec<usize> = (0..views).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let largest = eigen.eigenvalues[order[0]].max(0.0);
    let floor = (largest * GRAM_FLOOR * GRAM_FLOOR).max(tolerance * tolerance * (views * values) as f64);
    order.retain(|&k| eigen.eigenvalues[k] > floor && eigen.eigenvalues[k] > 0.0);
    order.truncate(most);
    let vectors =
        DMatrix::from_fn(order.len(), views, |k, j| eigen.eigenvectors[(j, order[k])] / (views as f64).sqrt());
    let layers = vectors * data;
    layers.row_iter().map(|row| signed(&row.iter().map(|&v| v as f32).collect::<Vec<_>>())).collect()
}

/// A layer as texels, with its largest entry positive: the same file whatever the eigen-solver's sign.
fn signed(values: &[f32]) -> Vec<[f32; 3]> {
    let extreme = values.iter().fold(0.0f32, |m, &v| if v.abs() > m.abs() { v } else { m });
    let sign = if extreme < 0.0 { -1.0 } else { 1.0 };
    values.as_chunks::<3>().0.iter().map(|t| t.map(|v| v * sign)).collect()
}

fn mean_layer(bake: &Bake<'_>, bases: &[Basis], options: &FitOptions) -> Option<Layer> {
    let (values, known): (Vec<_>, Vec<_>) = bases.iter().map(|b| (b.mean.clone(), b.seen.clone())).unzip();
    base_layer(&bake.paint(&values, &known), options)
}

/// Layer `k` of all facets that have one, in 8 bits about 128.
fn basis_layer(bake: &Bake<'_>, bases: &[Basis], k: usize, options: &FitOptions) -> Option<Layer> {
    let values: Vec<Vec<[f32; 3]>> =
        bases.iter().map(|b| b.layers.get(k).cloned().unwrap_or_else(|| vec![[0.0; 3]; b.seen.len()])).collect();
    // Known everywhere: what is unseen, or beyond a facet's rank, is zero, so that nothing spills into it
    // from facets whose layers mean something else.
    let known: Vec<Vec<bool>> = bases.iter().map(|b| vec![true; b.seen.len()]).collect();
    let scale = (clip_level(&values) / 127.0).max(1e-6);
    let stored = bake.paint(&values, &known).map(|p| p.map(|v| (128.0 + v / scale).round().clamp(1.0, 255.0) as u8));
    let coded = coding::encode_jpeg(&stored, options.quantiser / f64::from(scale))?;
    let texels = coding::decode(&coded, bake.surface.size).ok()?;
    Some(Layer { texels, scale, offset: -128.0 * scale, coded })
}

fn clip_level(values: &[Vec<[f32; 3]>]) -> f32 {
    let mut sizes: Vec<f32> = values.iter().flatten().flatten().map(|v| v.abs()).filter(|&v| v > 0.0).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let rank = ((sizes.len() as f64 * (1.0 - CLIPPED)) as usize).min(sizes.len() - 1);
    *sizes.select_nth_unstable_by(rank, f32::total_cmp).1
}

/// Coefficients of a facet against the layers as they will be decoded.
fn facet_weights(bake: &Bake<'_>, facet: usize, rank: usize, decoded: &[Image<[f32; 3]>]) -> FacetWeights {
    let directions = bake.directions(facet);
    let completed = complete(&bake.samples(facet), &directions);
    let columns: Vec<Vec<[f32; 3]>> = decoded[..rank].iter().map(|image| bake.texels_of(facet, image)).collect();
    let coefficients = refit(&completed, &columns);
    let own: Vec<_> = completed.views.iter().map(|&j| directions[j]).collect();
    let groups = merge_directions(&own);
    let mut table = Vec::with_capacity(groups.len() * rank);
    for group in &groups {
        table.push(1.0);
        let mean = |k: usize| group.iter().map(|&j| coefficients[(k, j)]).sum::<f64>() / group.len() as f64;
        table.extend((0..rank - 1).map(|k| mean(k) as f32));
    }
    let sites: Vec<_> = groups.iter().map(|g| own[g[0]]).collect();
    FacetWeights {
        center: bake.facets.centers[facet],
        complex: DirectionComplex::build(&sites, bake.layout),
        rank,
        table,
    }
}

/// `argmin_Y ‖D − B Y‖²` with a ridge far below the layers' energy: rank−1 × views.
fn refit(completed: &Completed, columns: &[Vec<[f32; 3]>]) -> DMatrix<f64> {
    let (rank, views) = (columns.len() - 1, completed.views.len());
    let data = centred(completed, &columns[0]);
    let basis = DMatrix::from_fn(rank, 3 * columns[0].len(), |k, row| f64::from(columns[k + 1][row / 3][row % 3]));
    let mut normal = &basis * basis.transpose();
    let ridge = 1e-6 * normal.trace() / rank.max(1) as f64 + 1e-9;
    normal += DMatrix::from_diagonal(&DVector::from_element(rank, ridge));
    let right = basis * data.transpose();
    normal.cholesky().map_or_else(|| DMatrix::zeros(rank, views), |c| c.solve(&right))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Colours without structure, nothing missing.
    fn noise(texels: usize, views: usize) -> Completed {
        let mixed = |i: usize| (i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29);
        let value = |i: usize| (mixed(mixed(i) as usize) >> 40) as f32 / 65_793.0;
        let colors = (0..texels * views).map(|i| [0, 1, 2].map(|c| value(3 * i + c))).collect();
        Completed { views: (0..views).collect(), colors, seen: vec![true; texels] }
    }

    fn columns(data: &Completed, most: usize, tolerance: f64) -> Vec<Vec<[f32; 3]>> {
        let mean = row_means(data);
        let layers = components(&centred(data, &mean), most, tolerance);
        std::iter::once(mean).chain(layers).collect()
    }

    fn largest_residual(data: &Completed, columns: &[Vec<[f32; 3]>]) -> f64 {
        let y = refit(data, columns);
        let views = data.views.len();
        let shown = |i: usize, j: usize, c: usize| {
            let moved: f64 = (1..columns.len()).map(|k| y[(k - 1, j)] * f64::from(columns[k][i][c])).sum();
            f64::from(columns[0][i][c]) + moved
        };
        let entries = (0..data.colors.len()).flat_map(|e| (0..3).map(move |c| (e / views, e % views, c)));
        entries.map(|(i, j, c)| (shown(i, j, c) - f64::from(data.colors[i * views + j][c])).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn all_components_give_the_data_back() {
        // m − 1 components and the mean are the m views.
        for (texels, views) in [(50, 12), (3, 12), (200, 2)] {
            let data = noise(texels, views);
            let columns = columns(&data, views - 1, 0.0);
            assert!(columns.len() <= views);
            let residual = largest_residual(&data, &columns);
            assert!(residual < 1e-2, "{residual} of {texels} texels in {views} views");
        }
    }

    #[test]
    fn coefficients_have_unit_rms_and_layers_fall_in_strength() {
        let data = noise(80, 10);
        let columns = columns(&data, 9, 0.0);
        let y = refit(&data, &columns);
        for k in 0..9 {
            let rms = (y.row(k).norm_squared() / 10.0).sqrt();
            assert!((rms - 1.0).abs() < 1e-3, "{rms} of layer {k}");
        }
        let energy = |k: usize| columns[k].as_flattened().iter().map(|v| v * v).sum::<f32>();
        assert!((1..9).all(|k| energy(k) >= energy(k + 1)));
    }

    #[test]
    fn equal_views_have_no_component() {
        let one = noise(30, 1);
        let colors = one.colors.iter().flat_map(|&c| [c; 6]).collect();
        let data = Completed { views: (0..6).collect(), colors, seen: vec![true; 30] };
        assert_eq!(columns(&data, 5, 0.01).len(), 1);
    }
}
