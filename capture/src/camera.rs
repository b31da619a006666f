//! Pinhole cameras with Brown–Conrady distortion.
//!
//! One convention inside the code: camera axes x right, y down, z forward (OpenCV); the pose maps
//! world to camera; pixel (0, 0) is the outer corner of the top-left pixel, whose centre is
//! (0.5, 0.5). All in `f64`.

use nalgebra::{Matrix3, Matrix3x4, Point2, Point3, Vector2, Vector3};

/// Brown–Conrady coefficients: `x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 xy + p2 (r² + 2x²)`,
/// and the same with x and y, p1 and p2 exchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Radial, second order.
    pub k1: f64,
    /// Radial, fourth order.
    pub k2: f64,
    /// Radial, sixth order.
    pub k3: f64,
    /// Tangential, vertical.
    pub p1: f64,
    /// Tangential, horizontal.
    pub p2: f64,
}

/// From camera axes to pixels: `u = fx x + skew y + cx`, `v = fy y + cy` with `x = X/Z`, `y = Y/Z`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Focal length in pixels along x.
    pub fx: f64,
    /// Focal length in pixels along y.
    pub fy: f64,
    /// Skew in pixels; zero for real lenses, not for cameras from arbitrary projection matrices.
    pub skew: f64,
    /// Principal point, column, in half-integer pixel coordinates.
    pub cx: f64,
    /// Principal point, row, in half-integer pixel coordinates.
    pub cy: f64,
    /// Lens distortion; all zero for a pinhole.
    pub distortion: Distortion,
    /// Image width in pixels.
    pub width: usize,
    /// Image height in pixels.
    pub height: usize,
}

/// A camera with its pose: `X_camera = rotation · X_world + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// How camera axes map to pixels.
    pub intrinsics: Intrinsics,
    /// World to camera, a proper rotation.
    pub rotation: Matrix3<f64>,
    /// World to camera, in world units.
    pub translation: Vector3<f64>,
}

/// Where a point lands in the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// In half-integer pixel coordinates; may lie outside the frame.
    pub pixel: Point2<f64>,
    /// Along the optical axis, in world units, positive.
    pub depth: f64,
}

/// A half-line in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Point3<f64>,
    /// Its unit direction.
    pub direction: Vector3<f64>,
}

impl Distortion {
    /// Whether this is a pinhole.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Distorts a point on the normalised image plane. `None` beyond the radius where the radial
    /// polynomial stops growing: there the model folds back and would show ghosts.
    pub fn distort(&self, p: Vector2<f64>) -> Option<Vector2<f64>> {
        let r2 = p.norm_squared();
        let slope = 1.0 + r2 * (3.0 * self.k1 + r2 * (5.0 * self.k2 + r2 * 7.0 * self.k3));
        if slope <= 0.0 {
            return None;
        }
        Some(self.distort_unchecked(p))
    }

    fn distort_unchecked(&self, p: Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (p.x, p.y);
        let r2 = p.norm_squared();
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        Vector2::new(
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + 2.0 * self.p2 * x * y + self.p1 * (r2 + 2.0 * y * y),
        )
    }

    /// The inverse of [`Distortion::distort`], by damped fixed-point steps and then Newton's method
    /// with a numerical Jacobian. `None` where it does not converge to 1e-10.
    pub fn undistort(&self, d: Vector2<f64>) -> Option<Vector2<f64>> {
        if self.is_none() {
            return Some(d);
        }
        let mut p = d;
        for _ in 0..5 {
            p += d - self.distort_unchecked(p);
        }
        for _ in 0..20 {
            let residual = self.distort_unchecked(p) - d;
            if residual.norm() < 1e-14 {
                break;
            }
            let h = 1e-7;
            let dx = (self.distort_unchecked(p + Vector2::new(h, 0.0))
                - self.distort_unchecked(p - Vector2::new(h, 0.0)))
                / (2.0 * h);
            let dy = (self.distort_unchecked(p + Vector2::new(0.0, h))
                - self.distort_unchecked(p - Vector2::new(0.0, h)))
                / (2.0 * h);
            let jacobian = nalgebra::Matrix2::from_columns(&[dx, dy]);
            p -= jacobian.try_inverse()? * residual;
        }
        let back = self.distort(p)?;
        ((back - d).norm() < 1e-10).then_some(p)
    }
}

impl Intrinsics {
    /// A pinhole of `focal` pixels whose axis goes through the middle of the image, of `[width, height]` pixels.
    pub fn pinhole(focal: f64, [width, height]: [usize; 2]) -> Self {
        let (cx, cy) = (0.5 * width as f64, 0.5 * height as f64);
        Self { fx: focal, fy: focal, skew: 0.0, cx, cy, distortion: Distortion::default(), width, height }
    }

    /// `[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]`.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, self.skew, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    /// Normalised image plane → pixel, without distortion.
    pub fn pixel_from_plane(&self, p: Vector2<f64>) -> Point2<f64> {
        Point2::new(self.fx * p.x + self.skew * p.y + self.cx, self.fy * p.y + self.cy)
    }

    /// Pixel → normalised image plane, without distortion.
    pub fn plane_from_pixel(&self, pixel: Point2<f64>) -> Vector2<f64> {
        let y = (pixel.y - self.cy) / self.fy;
        Vector2::new((pixel.x - self.cx - self.skew * y) / self.fx, y)
    }

    /// The pixel an ideal pinhole with the same matrix would have seen; identity without distortion.
    /// `None` where the lens model has no inverse.
    pub fn undistort_pixel(&self, pixel: Point2<f64>) -> Option<Point2<f64>> {
        if self.distortion.is_none() {
            return Some(pixel);
        }
        Some(self.pixel_from_plane(self.distortion.undistort(self.plane_from_pixel(pixel))?))
    }
}

impl Camera {
    /// The centre of projection in the world, `−Rᵀ t`.
    pub fn center(&self) -> Point3<f64> {
        Point3::from(-(self.rotation.transpose() * self.translation))
    }

    /// Unit optical axis in the world, forward.
    pub fn forward(&self) -> Vector3<f64> {
        self.rotation.row(2).transpose()
    }

    /// A world point in camera axes.
    pub fn to_camera(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.rotation * point.coords + self.translation
    }

    /// Projects a world point; `None` behind the camera, or where the lens model folds.
    pub fn project(&self, point: &Point3<f64>) -> Option<Projected> {
        let c = self.to_camera(point);
        if c.z.is_nan() || c.z <= 0.0 {
            return None;
        }
        let plane = Vector2::new(c.x / c.z, c.y / c.z);
        let plane =
            if self.intrinsics.distortion.is_none() { plane } else { self.intrinsics.distortion.distort(plane)? };
        Some(Projected { pixel: self.intrinsics.pixel_from_plane(plane), depth: c.z })
    }

    /// `K [R | t]`: the pinhole part alone, in half-integer pixel coordinates.
    pub fn projection_matrix(&self) -> Matrix3x4<f64> {
        let mut pose = Matrix3x4::zeros();
        pose.fixed_columns_mut::<3>(0).copy_from(&self.rotation);
        pose.set_column(3, &self.translation);
        self.intrinsics.matrix() * pose
    }

    /// The viewing ray of a pixel; `None` where the lens model has no inverse.
    pub fn ray(&self, pixel: Point2<f64>) -> Option<Ray> {
        let plane = self.intrinsics.distortion.undistort(self.intrinsics.plane_from_pixel(pixel))?;
        let direction = self.rotation.transpose() * Vector3::new(plane.x, plane.y, 1.0);
        Some(Ray { origin: self.center(), direction: direction.normalize() })
    }

    /// The same camera for the image reduced by the whole number `factor`.
    pub fn downscaled(&self, factor: usize) -> Self {
        let s = 1.0 / factor as f64;
        let i = self.intrinsics;
        let intrinsics = Intrinsics {
            fx: i.fx * s,
            fy: i.fy * s,
            skew: i.skew * s,
            cx: i.cx * s,
            cy: i.cy * s,
            width: i.width / factor,
            height: i.height / factor,
            ..i
        };
        Self { intrinsics, ..*self }
    }

    /// Whether a pixel lies inside the frame.
    pub fn in_frame(&self, pixel: Point2<f64>) -> bool {
        pixel.x >= 0.0
            && pixel.y >= 0.0
            && pixel.x < self.intrinsics.width as f64
            && pixel.y < self.intrinsics.height as f64
    }
}
