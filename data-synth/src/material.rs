//! What light does where it meets a part of a scene.
//!
//! Glazed: a Lambertian base under a dielectric coat of microfacets, Torrance–Sparrow with the GGX
//! distribution and Smith's height-correlated masking (Walter et al. 2007; Heitz 2014), Fresnel's
//! unpolarised reflectance, sampled by visible normals (Heitz, "Sampling the GGX Distribution of Visible
//! Normals", JCGT 2018). Scattering between facets is left to the base, which gets exactly what the coat
//! does not reflect (Kelemen and Szirmay-Kalos 2001):
//!
//! ```text
//! f = F D G / (4 cos_i cos_o) + albedo/π · (1 − E(cos_i)) (1 − E(cos_o)) / (1 − mean E)
//! ```
//!
//! `E` is the coat's directional albedo. The sum is reciprocal, and reflects everything when the
//! albedo is one: the white furnace closes.
//!
//! Metal: the same sum, with Schlick's Fresnel term that starts at the paint, `E` of facets that
//! reflect everything, and as albedo what light that bounces between facets keeps (Kulla and Conty,
//! "Revisiting Physically Based Shading at Imageworks", 2017): `F² Ē / (1 − F (1 − Ē))`, `F` averaged
//! over directions.
//!
//! Translucent: glazed, but the base is what comes out of the body around the point; see `medium`. Light enters by
//! the factor `1 − E(cos_o)` and leaves by `(1 − E(cos_i)) / (1 − mean E)`: the same sum, with the exit
//! elsewhere.
//!
//! Directions are unit, in the frame whose z is the normal.

use crate::medium::Medium;
use nalgebra::Vector3;
use std::f32::consts::PI;

/// A direction, a colour or a point in single precision.
pub(crate) type Vec3 = Vector3<f32>;

/// Entries of the table of `E`; linear interpolation is then within 2e-3 for roughness ≥ 0.05.
const TABLE: usize = 96;
/// Quasi-random directions per entry.
const TABLE_SAMPLES: u32 = 2048;
/// Cosines below this are grazing beyond what `f32` resolves; they reflect nothing.
const GRAZING: f32 = 1e-4;

/// A layer of microfacets over a base.
#[derive(Clone, Debug)]
pub(crate) struct Coat {
    alpha: f32,
    fresnel: Fresnel,
    albedo: Vec<f32>,
    mean_albedo: f32,
}

/// How much a facet reflects.
#[derive(Clone, Copy, Debug)]
enum Fresnel {
    /// A dielectric of this index of refraction.
    Dielectric(f32),
    /// A metal of the paint's colour.
    Metal,
}

/// What a part of a scene is made of; its colour is the scene's paint.
#[derive(Clone, Debug)]
pub(crate) enum Finish {
    /// Lambertian; the paint is its reflectance.
    Matt,
    /// A dielectric coat over a Lambertian base of the paint's reflectance.
    Glazed(Coat),
    /// Facets of metal; the paint is their reflectance at normal incidence.
    Metal(Coat),
    /// Light goes through, refracted by this index; the paint is what one passage of the surface keeps.
    Glass(f32),
    /// A coat over a body in which light is scattered; the paint is the reflectance of a thick body.
    Translucent(Coat, Medium),
}

/// What light meets at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface<'a> {
    /// Reflectance of the base, or of the metal at normal incidence, linear RGB.
    pub(crate) albedo: Vec3,
    /// The coat, if any.
    pub(crate) coat: Option<&'a Coat>,
    /// Which part of the sum above this is.
    pub(crate) lobes: Lobes,
}

/// Parts of the reflection at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Lobes {
    /// Coat and base.
    All,
    /// The coat alone: the base is inside.
    Entry,
    /// What comes out from inside, alone; followed with this probability.
    Exit(f32),
}

/// A sampled direction to follow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scatter {
    /// Towards where light comes from.
    pub(crate) wi: Vec3,
    /// `f cos / pdf`.
    pub(crate) weight: Vec3,
    /// Density in solid angle.
    pub(crate) pdf: f32,
}

impl Finish {
    /// A coat of GGX roughness `alpha` (0.1 is glossy, 0.4 satin) and index of refraction `ior`.
    pub(crate) fn glazed(alpha: f32, ior: f32) -> Self {
        Self::Glazed(Coat::new(alpha, ior))
    }

    /// Metal of GGX roughness `alpha`.
    pub(crate) fn metal(alpha: f32) -> Self {
        Self::Metal(Coat::tabulated(alpha, Fresnel::Metal))
    }

    /// Clear, smooth glass of index of refraction `ior`.
    pub(crate) fn glass(ior: f32) -> Self {
        Self::Glass(ior)
    }

    /// A glazed body in which light is scattered every `mean_free_path` metres on average.
    pub(crate) fn translucent(alpha: f32, ior: f32, mean_free_path: f32) -> Self {
        Self::Translucent(Coat::new(alpha, ior), Medium { mean_free_path })
    }

    /// The coat, where there is one.
    pub(crate) fn coat(&self) -> Option<&Coat> {
        match self {
            Self::Matt | Self::Glass(_) => None,
            Self::Glazed(coat) | Self::Metal(coat) | Self::Translucent(coat, _) => Some(coat),
        }
    }
}

impl Coat {
    /// A dielectric coat of GGX roughness `alpha` and index of refraction `ior`.
    pub(crate) fn new(alpha: f32, ior: f32) -> Self {
        Self::tabulated(alpha, Fresnel::Dielectric(ior))
    }

    fn tabulated(alpha: f32, fresnel: Fresnel) -> Self {
        let mut coat = Self { alpha, fresnel, albedo: Vec::new(), mean_albedo: 0.0 };
        coat.albedo = (0..TABLE).map(|i| coat.integrate_albedo(table_cosine(i))).collect();
        coat.mean_albedo = coat.integrate_mean();
        coat
    }

    /// Share of light from direction `cos` that the coat reflects; of a metal, if its facets reflected all.
    pub(crate) fn directional_albedo(&self, cos: f32) -> f32 {
        let at = cos.clamp(0.0, 1.0).sqrt() * (TABLE - 1) as f32;
        let i = (at as usize).min(TABLE - 2);
        let t = at - i as f32;
        self.albedo[i] * (1.0 - t) + self.albedo[i + 1] * t
    }

    /// `E(cos) = mean of F G2 / G1` over visible normals.
    fn integrate_albedo(&self, cos: f32) -> f32 {
        let wo = Vec3::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
        let sum: f64 = (0..TABLE_SAMPLES)
            .map(|i| {
                let u = [(i as f32 + 0.5) / TABLE_SAMPLES as f32, crate::sampler::unit(i.reverse_bits())];
                let h = self.sample_visible_normal(wo, u);
                let wi = reflect(wo, h);
                let share = self.fresnel(wo.dot(&h), Vec3::repeat(1.0)).x * self.g2(wi, wo) / self.g1(wo);
                if wi.z <= GRAZING { 0.0 } else { f64::from(share) }
            })
            .sum();
        (sum / f64::from(TABLE_SAMPLES)) as f32
    }

    /// `2 ∫ E(μ) μ dμ` by the midpoint rule.
    fn integrate_mean(&self) -> f32 {
        const STEPS: usize = 4096;
        let mean = |i| {
            let mu = (i as f32 + 0.5) / STEPS as f32;
            f64::from(2.0 * self.directional_albedo(mu) * mu) / STEPS as f64
        };
        (0..STEPS).map(mean).sum::<f64>() as f32
    }

    /// GGX density of facet normals, per projected solid angle.
    fn d(&self, h: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        // 1 − z² + a² z² from x and y: no cancellation at the peak.
        let k = h.x * h.x + h.y * h.y + a2 * h.z * h.z;
        a2 / (PI * k * k)
    }

    fn lambda(&self, w: Vec3) -> f32 {
        let tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
        0.5 * ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0)
    }

    fn g1(&self, w: Vec3) -> f32 {
        1.0 / (1.0 + self.lambda(w))
    }

    fn g2(&self, wi: Vec3, wo: Vec3) -> f32 {
        1.0 / (1.0 + self.lambda(wi) + self.lambda(wo))
    }

    /// What a facet reflects at this cosine; `paint` is a metal's at normal incidence.
    fn fresnel(&self, cos: f32, paint: Vec3) -> Vec3 {
        match self.fresnel {
            Fresnel::Dielectric(ior) => Vec3::repeat(fresnel_dielectric(cos, ior)),
            Fresnel::Metal => {
                let grazing = (1.0 - cos.clamp(0.0, 1.0)).powi(5);
                paint.map(|c| c + (1.0 - c) * grazing)
            }
        }
    }

    /// Reflectance of the base: the paint, or what light between the facets of a metal keeps.
    fn base(&self, paint: Vec3) -> Vec3 {
        match self.fresnel {
            Fresnel::Dielectric(_) => paint,
            Fresnel::Metal => paint.map(|c| {
                // 2 ∫ F(μ) μ dμ of Schlick's term.
                let mean = (20.0 * c + 1.0) / 21.0;
                mean * mean * self.mean_albedo / (1.0 - mean * (1.0 - self.mean_albedo))
            }),
        }
    }

    /// Heitz 2018, listing 1.
    fn sample_visible_normal(&self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        // Stretch the view to the hemisphere configuration.
        let v = Vec3::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let length2 = v.x * v.x + v.y * v.y;
        let t1 = if length2 > 1e-12 { Vec3::new(-v.y, v.x, 0.0) / length2.sqrt() } else { Vec3::x() };
        let t2 = v.cross(&t1);
        // Sample the projected disk, folding the half that is hidden.
        let (r, phi) = (u[0].sqrt(), 2.0 * PI * u[1]);
        let p1 = r * phi.cos();
        let s = 0.5 * (1.0 + v.z);
        let p2 = (1.0 - s) * (1.0 - p1 * p1).max(0.0).sqrt() + s * r * phi.sin();
        // Lift to the hemisphere and unstretch.
        let n = t1 * p1 + t2 * p2 + v * (1.0 - p1 * p1 - p2 * p2).max(0.0).sqrt();
        Vec3::new(self.alpha * n.x, self.alpha * n.y, n.z.max(1e-6)).normalize()
    }

    fn evaluate(&self, wi: Vec3, wo: Vec3, paint: Vec3) -> Vec3 {
        let Some(h) = (wi + wo).try_normalize(1e-6) else { return Vec3::zeros() };
        self.fresnel(wo.dot(&h), paint) * (self.d(h) * self.g2(wi, wo) / (4.0 * wi.z * wo.z))
    }

    /// `D_visible(h) / (4 wo·h) = G1 D / (4 cos_o)`.
    fn pdf(&self, wi: Vec3, wo: Vec3) -> f32 {
        (wi + wo).try_normalize(1e-6).map_or(0.0, |h| self.g1(wo) * self.d(h) / (4.0 * wo.z))
    }

    /// What passes the coat on its way in, towards the base.
    pub(crate) fn entry_factor(&self, wo: Vec3) -> f32 {
        1.0 - self.directional_albedo(wo.z)
    }

    /// What of the light from the base passes the coat on its way out.
    fn exit_factor(&self, wi: Vec3) -> f32 {
        // Facets too smooth to scatter among themselves: nothing is left to share out.
        (1.0 - self.directional_albedo(wi.z)) / (1.0 - self.mean_albedo).max(1e-6)
    }
}

impl Surface<'_> {
    /// `f(wi, wo)`, without the cosine.
    pub(crate) fn evaluate(&self, wi: Vec3, wo: Vec3) -> Vec3 {
        if wi.z <= GRAZING || wo.z <= GRAZING {
            return Vec3::zeros();
        }
        let Some(coat) = self.coat else { return self.albedo / PI };
        match self.lobes {
            Lobes::All => {
                let base = coat.base(self.albedo) * (coat.entry_factor(wo) * coat.exit_factor(wi) / PI);
                base + coat.evaluate(wi, wo, self.albedo)
            }
            Lobes::Entry => coat.evaluate(wi, wo, self.albedo),
            Lobes::Exit(_) => self.albedo * (coat.exit_factor(wi) / PI),
        }
    }

    /// Density with which [`Surface::sample`] returns `wi`.
    pub(crate) fn pdf(&self, wi: Vec3, wo: Vec3) -> f32 {
        if wi.z <= GRAZING || wo.z <= GRAZING {
            return 0.0;
        }
        let p = self.coat_share(wo);
        let coat = self.coat.filter(|_| p > 0.0).map_or(0.0, |c| c.pdf(wi, wo));
        let base = match self.lobes {
            Lobes::All => 1.0 - p,
            // The rest of the draws goes inside.
            Lobes::Entry => 0.0,
            Lobes::Exit(share) => share,
        };
        p * coat + base * wi.z / PI
    }

    /// Draws a direction; `None` where the draw falls below the surface, or inside.
    pub(crate) fn sample(&self, wo: Vec3, mut u: [f32; 2]) -> Option<Scatter> {
        if wo.z <= GRAZING {
            return None;
        }
        let p = self.coat_share(wo);
        let wi = match self.coat {
            // The first number chooses the layer and is stretched back to [0, 1): stays stratified.
            Some(coat) if u[0] < p => {
                u[0] /= p;
                reflect(wo, coat.sample_visible_normal(wo, u))
            }
            _ if self.lobes == Lobes::Entry => return None,
            _ => {
                u[0] = (u[0] - p) / (1.0 - p);
                cosine_hemisphere(u)
            }
        };
        let pdf = self.pdf(wi, wo);
        (pdf > 0.0).then(|| Scatter { wi, weight: self.evaluate(wi, wo) * (wi.z / pdf), pdf })
    }

    /// Probability of following the coat: its share of what is reflected, but not less than two in
    /// five. The base finds lights by shadow rays and the sky is smooth; a highlight found by one
    /// sample in ten is a speckle.
    pub(crate) fn coat_share(&self, wo: Vec3) -> f32 {
        let Some(coat) = self.coat.filter(|_| !matches!(self.lobes, Lobes::Exit(_))) else { return 0.0 };
        let e = coat.directional_albedo(wo.z);
        let (coated, base) = match coat.fresnel {
            Fresnel::Dielectric(_) => (e, (1.0 - e) * self.albedo.max()),
            Fresnel::Metal => (e * self.albedo.max(), (1.0 - e) * coat.base(self.albedo).max()),
        };
        let most = if matches!(coat.fresnel, Fresnel::Metal) { 0.99 } else { 0.9 };
        (coated / (coated + base).max(1e-9)).clamp(0.4, most)
    }
}

/// Fresnel's reflectance of unpolarised light that meets a dielectric; `eta` is the index beyond over
/// the index on this side. One beyond the critical angle.
pub(crate) fn fresnel_dielectric(cos: f32, eta: f32) -> f32 {
    let cos = cos.clamp(0.0, 1.0);
    let cos2_t = 1.0 - (1.0 - cos * cos) / (eta * eta);
    if cos2_t <= 0.0 {
        return 1.0;
    }
    let cos_t = cos2_t.sqrt();
    let s = (cos - eta * cos_t) / (cos + eta * cos_t);
    let p = (eta * cos - cos_t) / (eta * cos + cos_t);
    0.5 * (s * s + p * p)
}

/// `wo` mirrored at `h`.
pub(crate) fn reflect(wo: Vec3, h: Vec3) -> Vec3 {
    h * (2.0 * wo.dot(&h)) - wo
}

/// Uniform on the unit disk, area-preserving and continuous (Shirley and Chiu 1997).
pub(crate) fn concentric_disk(u: [f32; 2]) -> [f32; 2] {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0, 0.0];
    }
    let (r, phi) = if a.abs() > b.abs() { (a, PI / 4.0 * (b / a)) } else { (b, PI / 2.0 - PI / 4.0 * (a / b)) };
    [r * phi.cos(), r * phi.sin()]
}

fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let [x, y] = concentric_disk(u);
    Vec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// An orthonormal frame with the given z (Duff et al., "Building an Orthonormal Basis, Revisited",
/// JCGT 2017).
pub(crate) fn frame_around(n: Vec3) -> [Vec3; 3] {
    let sign = 1.0_f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y), n]
}

/// Cosine of a table entry: square-root spacing, dense at grazing where Fresnel rises.
fn table_cosine(i: usize) -> f32 {
    let s = i as f32 / (TABLE - 1) as f32;
    (s * s).max(1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wo(cos: f32) -> Vec3 {
        Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos)
    }

    /// Mean and standard error of the sampled reflectance under a white sky.
    fn furnace(surface: &Surface<'_>, wo: Vec3, n: u32) -> (f64, f64) {
        let (mut sum, mut sum2) = (0.0, 0.0);
        for i in 0..n {
            let u = [
                crate::sampler::unit(crate::sampler::mix(2 * i)),
                crate::sampler::unit(crate::sampler::mix(2 * i + 1)),
            ];
            let x = surface.sample(wo, u).map_or(0.0, |s| f64::from(s.weight.x));
            sum += x;
            sum2 += x * x;
        }
        let mean = sum / f64::from(n);
        (mean, ((sum2 / f64::from(n) - mean * mean) / f64::from(n)).sqrt())
    }

    #[test]
    fn white_furnace_closes_under_every_coat() {
        for alpha in [0.08, 0.2, 0.6] {
            let coat = Coat::new(alpha, 1.5);
            let surface = Surface { albedo: Vec3::repeat(1.0), coat: Some(&coat), lobes: Lobes::All };
            for cos in [0.15, 0.5, 0.95] {
                let (mean, error) = furnace(&surface, wo(cos), 200_000);
                // 2e-3: interpolation of the table, stated at TABLE.
                assert!((mean - 1.0).abs() < 3.0 * error + 2e-3, "alpha {alpha} cos {cos}: {mean} ± {error}");
            }
        }
    }

    #[test]
    fn coat_alone_never_gains_energy_and_matches_its_table() {
        for alpha in [0.05, 0.3, 1.0] {
            let coat = Coat::new(alpha, 1.5);
            let surface = Surface { albedo: Vec3::zeros(), coat: Some(&coat), lobes: Lobes::All };
            for cos in [0.05, 0.3, 0.7, 1.0] {
                let (mean, error) = furnace(&surface, wo(cos), 100_000);
                assert!(mean <= 1.0 + 3.0 * error, "gains energy: {mean}");
                let table = f64::from(coat.directional_albedo(cos));
                assert!((mean - table).abs() < 3.0 * error + 2e-3, "{mean} against {table} ± {error}");
            }
        }
    }

    #[test]
    fn ggx_facets_project_to_the_unit_area() {
        // ∫ D(h) cos dω = 1, the definition of a normal distribution (Walter et al. 2007, eq. 4).
        for alpha in [0.1, 0.4, 0.9] {
            let coat = Coat::new(alpha, 1.5);
            let n = 200_000;
            let integral: f64 = (0..n)
                .map(|i| {
                    // Substitution cos = c(t) with t² concentrates points at the peak.
                    let t = (f64::from(i) + 0.5) / f64::from(n);
                    let theta = t * t * std::f64::consts::FRAC_PI_2;
                    let (s, c) = theta.sin_cos();
                    let d = f64::from(coat.d(Vec3::new(s as f32, 0.0, c as f32)));
                    d * c * s * std::f64::consts::TAU * std::f64::consts::PI * t / f64::from(n)
                })
                .sum();
            assert!((integral - 1.0).abs() < 1e-3, "alpha {alpha}: {integral}");
        }
    }

    #[test]
    fn reflectance_is_reciprocal() {
        let coat = Coat::new(0.3, 1.5);
        let surface = Surface { albedo: Vec3::new(0.2, 0.5, 0.8), coat: Some(&coat), lobes: Lobes::All };
        let (a, b) = (wo(0.4), Vec3::new(-0.3, 0.5, 0.7).normalize());
        assert!((surface.evaluate(a, b) - surface.evaluate(b, a)).norm() < 1e-5);
    }

    #[test]
    fn normal_incidence_reflects_four_percent() {
        // ((n − 1) / (n + 1))² = 0.04 for n = 1.5.
        assert!((fresnel_dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        // Seen from inside beyond the critical angle, asin(1/1.5) = 41.8°, everything.
        assert_eq!(fresnel_dielectric(42_f32.to_radians().cos(), 1.0 / 1.5), 1.0);
    }
}
