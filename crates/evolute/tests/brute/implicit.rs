//! Surfaces by their equation: sampled along the ray.

use super::Root;
use evolute::geometry::{Point3, Ray, Transform, Vector3};
use evolute::surface::Surface;

/// Signs of the equation are known to this share of the coordinates: eighteen
/// roundings.
const ROUNDING: f64 = 4e-15;

/// Between two extrema of the equation lie several samples: along a ray the distance from a centre or an
/// axis has one minimum.
const SAMPLES: usize = 48;

/// An equation along a ray.
struct Along<'f> {
    /// Zero on the surface [m].
    f: &'f dyn Fn(f64) -> f64,
    /// Positive within the surface's border, in shares of the surface.
    margin: &'f dyn Fn(f64) -> f64,
    /// Rounding errors of both.
    f_rounding: f64,
    margin_rounding: f64,
    t_max: f64,
    speed: f64,
    /// Whether the equation is that of a plane, which has no extremum along a ray.
    plane: bool,
}

/// All roots at 0 < t ≤ `t_max`; `on_surface` if the ray starts on it.
pub fn roots(surface: &Surface, ray: &Ray, t_max: f64, on_surface: bool) -> Vec<Root> {
    let speed = ray.direction.norm();
    let length = t_max * speed;
    let plane = |transform: &Transform, c: Point3, n: Vector3, margin: &dyn Fn(Point3) -> f64| {
        // A plane that a ray leaves is not met again.
        if on_surface {
            return vec![];
        }
        let back = transform.inverse();
        let reach = length + ray.origin.coords.amax() + c.coords.amax();
        let smallest = [Vector3::x(), Vector3::y()].map(|e| transform.vector(&e).norm());
        Along {
            f: &|t| n.dot(&(ray.at(t) - c)),
            margin: &|t| margin(back.point(&ray.at(t))),
            f_rounding: ROUNDING * reach,
            margin_rounding: ROUNDING * reach / smallest[0].min(smallest[1]),
            t_max,
            speed,
            plane: true,
        }
        .roots(false)
    };
    match surface {
        Surface::Rectangle(s) => {
            plane(s.world_from_object(), s.centre(), s.normal().into_inner(), &|x| {
                1.0 - x.x.abs().max(x.y.abs())
            })
        }
        Surface::Disk(s) => {
            plane(s.world_from_object(), s.centre(), s.normal().into_inner(), &|x| {
                1.0 - x.x.hypot(x.y)
            })
        }
        Surface::Sphere(s) => {
            let (c, r) = (s.centre(), s.radius());
            Along {
                f: &|t| (ray.at(t) - c).norm() - r,
                margin: &|_| 1.0,
                f_rounding: ROUNDING * (r + (ray.origin - c).norm() + c.coords.amax()),
                margin_rounding: 0.0,
                t_max,
                speed,
                plane: false,
            }
            .roots(on_surface)
        }
        Surface::Cylinder(s) => {
            let ([a, b], r) = (s.ends(), s.radius());
            let axis = (b - a) / (b - a).norm_squared();
            let reach = r + (ray.origin - a).norm() + s.length() + a.coords.amax();
            Along {
                f: &|t| {
                    let x = ray.at(t) - a;
                    (x - (b - a) * axis.dot(&x)).norm() - r
                },
                margin: &|t| {
                    let h = axis.dot(&(ray.at(t) - a));
                    h.min(1.0 - h)
                },
                f_rounding: ROUNDING * reach,
                margin_rounding: ROUNDING * reach / s.length(),
                t_max,
                speed,
                plane: false,
            }
            .roots(on_surface)
        }
        Surface::Mesh(_) | Surface::Parametric(_) => panic!("no equation of this surface"),
    }
}

impl Along<'_> {
    fn roots(&self, on_surface: bool) -> Vec<Root> {
        let f = self.f;
        let at = |i: usize| self.t_max * i as f64 / SAMPLES as f64;
        let values: [f64; SAMPLES + 1] = std::array::from_fn(|i| f(at(i)));
        let mut roots = vec![];
        for i in 0..SAMPLES {
            let (fa, fb) = (values[i], values[i + 1]);
            let start = i == 0 && on_surface;
            if !start && (fa > 0.0) != (fb > 0.0) {
                self.push(self.bisected(at(i), at(i + 1)), true, &mut roots);
                continue;
            }
            // Equations are distances: along the ray they change by no more than its length.
            if self.plane
                || !start && fa.abs() + fb.abs() > 1.01 * self.t_max * self.speed / SAMPLES as f64
            {
                continue;
            }
            // Two roots in one interval: look for an extremum of the other sign.
            let sign = if fb > 0.0 { 1.0 } else { -1.0 };
            let slope_a = if i == 0 { f64::NEG_INFINITY } else { sign * (fa - values[i - 1]) };
            let slope_b =
                if i + 1 == SAMPLES { f64::INFINITY } else { sign * (values[i + 2] - fb) };
            let change = sign * (fb - fa);
            let slack = 100.0 * self.f_rounding;
            if !(start || slope_a < change + slack && slope_b > change - slack) {
                continue;
            }
            let (mut a, mut b) = (at(i), at(i + 1));
            for _ in 0..90 {
                const GOLDEN: f64 = 0.618_033_988_749_894_9;
                let (c, d) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
                if sign * f(c) < sign * f(d) { b = d } else { a = c }
            }
            let least = 0.5 * (a + b);
            let value = sign * f(least);
            if value < -self.f_rounding {
                if !start {
                    self.push(self.bisected(at(i), least), true, &mut roots);
                }
                self.push(self.bisected(least, at(i + 1)), true, &mut roots);
            } else if value < self.f_rounding
                && least < at(i + 1)
                && (!start || least > 1e-9 * self.t_max)
            {
                self.push(least, false, &mut roots);
            }
        }
        roots
    }

    fn bisected(&self, mut a: f64, mut b: f64) -> f64 {
        let sign = (self.f)(a) > 0.0;
        loop {
            let m = 0.5 * (a + b);
            if m <= a || m >= b {
                return m;
            }
            if ((self.f)(m) > 0.0) == sign { a = m } else { b = m }
        }
    }

    /// A root of the equation, if it is not outside the surface's border.
    fn push(&self, t: f64, mut certain: bool, roots: &mut Vec<Root>) {
        // Where the equation is beyond rounding on both sides.
        let mut dt = f64::EPSILON * self.t_max;
        while dt < 1e-4 * self.t_max
            && [t - dt, t + dt].iter().any(|&u| (self.f)(u).abs() < self.f_rounding)
        {
            dt *= 2.0;
        }
        let margins = [t - dt, t, t + dt].map(|u| (self.margin)(u));
        if margins.iter().all(|&m| m < -self.margin_rounding) {
            return;
        }
        certain &= margins.iter().all(|&m| m > self.margin_rounding);
        roots.push(Root { t, doubt: dt * self.speed, certain });
    }
}
