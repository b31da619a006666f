//! A Lambertian base under an optional smooth-to-rough dielectric coat.
//!
//! Coat: Torrance–Sparrow with the GGX distribution and Smith's height-correlated masking (Walter et
//! al. 2007; Heitz 2014), Fresnel's unpolarised reflectance, sampled by visible normals (Heitz,
//! "Sampling the GGX Distribution of Visible Normals", JCGT 2018). Its multiple scattering between
//! facets is left to the base, which gets exactly what the coat does not reflect (Kelemen and
//! Szirmay-Kalos 2001):
//!
//! ```text
//! f = F D G / (4 cos_i cos_o) + albedo/π · (1 − E(cos_i)) (1 − E(cos_o)) / (1 − mean E)
//! ```
//!
//! `E` is the coat's directional albedo. The sum is reciprocal, and reflects everything when the
//! albedo is one: the white furnace closes. Directions are unit, in the frame whose z is the normal.

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

/// A dielectric coat.
#[derive(Clone, Debug)]
pub(crate) struct Coat {
    alpha: f32,
    ior: f32,
    albedo: Vec<f32>,
    mean_albedo: f32,
}

/// What a part of a scene is made of; its colour is the scene's paint.
#[derive(Clone, Debug)]
pub(crate) enum Finish {
    /// Lambertian; the paint is its reflectance.
    Matt,
    /// A dielectric coat over a Lambertian base of the paint's reflectance.
    Glazed(Coat),
}

/// What light meets at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface<'a> {
    /// Reflectance of the base, linear RGB.
    pub(crate) albedo: Vec3,
    /// The coat, if any.
    pub(crate) coat: Option<&'a Coat>,
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
}

impl Coat {
    /// A coat of GGX roughness `alpha` and index of refraction `ior`.
    pub(crate) fn new(alpha: f32, ior: f32) -> Self {
        let mut coat = Self { alpha, ior, albedo: Vec::new(), mean_albedo: 0.0 };
        coat.albedo = (0..TABLE).map(|i| coat.integrate_albedo(table_cosine(i))).collect();
        coat.mean_albedo = coat.integrate_mean();
        coat
    }

    /// Share of light from direction `cos` that the coat reflects.
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
                if wi.z <= GRAZING { 0.0 } else { f64::from(self.fresnel(wo.dot(&h)) * self.g2(wi, wo) / self.g1(wo)) }
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

    /// Fresnel's reflectance of unpolarised light entering the coat.
    fn fresnel(&self, cos: f32) -> f32 {
        let cos = cos.clamp(0.0, 1.0);
        let cos_t = (1.0 - (1.0 - cos * cos) / (self.ior * self.ior)).max(0.0).sqrt();
        let s = (cos - self.ior * cos_t) / (cos + self.ior * cos_t);
        let p = (self.ior * cos - cos_t) / (self.ior * cos + cos_t);
        0.5 * (s * s + p * p)
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

    fn evaluate(&self, wi: Vec3, wo: Vec3) -> f32 {
        let Some(h) = (wi + wo).try_normalize(1e-6) else { return 0.0 };
        self.fresnel(wo.dot(&h)) * self.d(h) * self.g2(wi, wo) / (4.0 * wi.z * wo.z)
    }

    /// `D_visible(h) / (4 wo·h) = G1 D / (4 cos_o)`.
    fn pdf(&self, wi: Vec3, wo: Vec3) -> f32 {
        (wi + wo).try_normalize(1e-6).map_or(0.0, |h| self.g1(wo) * self.d(h) / (4.0 * wo.z))
    }

    fn base_factor(&self, wi: Vec3, wo: Vec3) -> f32 {
        let left = |w: Vec3| 1.0 - self.directional_albedo(w.z);
        left(wi) * left(wo) / (1.0 - self.mean_albedo)
    }
}

impl Surface<'_> {
    /// `f(wi, wo)`, without the cosine.
    pub(crate) fn evaluate(&self, wi: Vec3, wo: Vec3) -> Vec3 {
        if wi.z <= GRAZING || wo.z <= GRAZING {
            return Vec3::zeros();
        }
        let base = self.albedo / PI;
        self.coat.map_or(base, |c| base * c.base_factor(wi, wo) + Vec3::repeat(c.evaluate(wi, wo)))
    }

    /// Density with which [`Surface::sample`] returns `wi`.
    pub(crate) fn pdf(&self, wi: Vec3, wo: Vec3) -> f32 {
        if wi.z <= GRAZING || wo.z <= GRAZING {
            return 0.0;
        }
        let p = self.coat_share(wo);
        let coat = self.coat.map_or(0.0, |c| c.pdf(wi, wo));
        p * coat + (1.0 - p) * wi.z / PI
    }

    /// Draws a direction; `None` where the draw falls below the surface.
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
    fn coat_share(&self, wo: Vec3) -> f32 {
        self.coat.map_or(0.0, |coat| {
            let e = coat.directional_albedo(wo.z);
            let base = (1.0 - e) * self.albedo.max();
            (e / (e + base)).clamp(0.4, 0.9)
        })
    }
}

/// `wo` mirrored at `h`.
fn reflect(wo: Vec3, h: Vec3) -> Vec3 {
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
            let surface = Surface { albedo: Vec3::repeat(1.0), coat: Some(&coat) };
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
            let surface = Surface { albedo: Vec3::zeros(), coat: Some(&coat) };
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
        let surface = Surface { albedo: Vec3::new(0.2, 0.5, 0.8), coat: Some(&coat) };
        let (a, b) = (wo(0.4), Vec3::new(-0.3, 0.5, 0.7).normalize());
        assert!((surface.evaluate(a, b) - surface.evaluate(b, a)).norm() < 1e-5);
    }

    #[test]
    fn normal_incidence_reflects_four_percent() {
        // ((n − 1) / (n + 1))² = 0.04 for n = 1.5.
        assert!((Coat::new(0.1, 1.5).fresnel(1.0) - 0.04).abs() < 1e-6);
    }
}
