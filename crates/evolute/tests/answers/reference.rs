//! Specular irradiance through a ball of glass and from a mirror ring, written independently of the
//! library: no tracer, no cells, no derivatives.
//!
//! Both bodies are surfaces of revolution, and so the line in which a chain leaves them depends on one
//! of its two coordinates in closed form: on the azimuth φ about the line from the receiver to the
//! ball's centre as A + B cos φ + C sin φ, on the height y at which the ring is met as A + B y (both for
//! the six Plücker coordinates). Where a lamp's edges, the horizon and the ring's rim cut is then found
//! by solving, and the integral over that coordinate is a closed form. What is left is one integral over
//! the angle of incidence, or over the ring's azimuth, by adaptive Gauss quadrature.

use std::f64::consts::{FRAC_PI_2, TAU};

use evolute::geometry::{Point3, Vector3};

/// A parallelogram of radiance 1 on its front.
pub struct Lamp {
    /// Counter-clockwise seen from the front [m].
    pub corners: [Point3; 4],
}

impl Lamp {
    fn normal(&self) -> Vector3 {
        let [a, b, _, d] = self.corners;
        (b - a).cross(&(d - a)).normalize()
    }

    /// Plücker coordinates (b − a, a × b) of the edges about `at`, turned so that what meets the front
    /// inside passes all of them on the positive side.
    fn edges(&self, at: &Point3) -> [(Vector3, Vector3); 4] {
        std::array::from_fn(|k| {
            let (a, b) = (self.corners[k] - at, self.corners[(k + 1) % 4] - at);
            (a - b, b.cross(&a))
        })
    }
}

/// On which side of an edge the line through `o` along `d` passes.
fn side((along, moment): &(Vector3, Vector3), o: &Vector3, d: &Vector3) -> f64 {
    d.dot(moment) + o.cross(d).dot(along)
}

/// How finely to look.
#[derive(Clone, Copy)]
pub struct Fineness {
    /// Points at which is asked what cuts: what is lit must not fit between two.
    pub looks: u32,
    /// An interval is halved while that changes it by more than this share of the whole.
    pub change: f64,
}

/// Points and weights of Gauss's rule of five on [0, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// Irradiance per unit of radiance that is as good as none: rounding must not be chased.
const LEAST: f64 = 1e-9;

/// Which bounds cut, as one number, and what is within them.
type Within<const W: usize> = (u64, [f64; W]);

/// Appends all places between `a` and `b` at which what cuts changes.
fn changes(found: &mut Vec<f64>, a: (f64, u64), b: (f64, u64), cuts: &dyn Fn(f64) -> u64) {
    let middle = 0.5 * (a.0 + b.0);
    if a.1 == b.1 {
        return;
    }
    if b.0 - a.0 < 1e-14 {
        found.push(middle);
        return;
    }
    let m = (middle, cuts(middle));
    changes(found, a, m, cuts);
    changes(found, m, b, cuts);
}

/// ∫ f from the first to the last of the places looked at (in rising order), each component. Between
/// changes of what cuts, f is smooth but for roots at its ends, which t² (3 − 2 t) takes away.
fn integral<const W: usize>(
    looks: &[f64],
    fineness: Fineness,
    f: impl Fn(f64) -> Within<W>,
) -> [f64; W] {
    let cuts = |x: f64| f(x).0;
    let seen: Vec<(f64, u64)> = looks.iter().map(|x| (*x, cuts(*x))).collect();
    let mut ends = vec![looks[0]];
    for pair in seen.windows(2) {
        changes(&mut ends, pair[0], pair[1], &cuts);
    }
    ends.push(looks[looks.len() - 1]);
    let gauss = |piece: &[f64], t0: f64, t1: f64| {
        let mut sum = [0.0; W];
        for (t, w) in GAUSS {
            let t = t0 + (t1 - t0) * t;
            let (_, value) = f(piece[0] + (piece[1] - piece[0]) * t * t * (3.0 - 2.0 * t));
            let w = w * (t1 - t0) * 6.0 * t * (1.0 - t) * (piece[1] - piece[0]);
            sum = std::array::from_fn(|k| sum[k] + w * value[k]);
        }
        sum
    };
    let mut open: Vec<_> =
        ends.windows(2).map(|piece| (piece, 0.0, 1.0, gauss(piece, 0.0, 1.0))).collect();
    let whole = open.iter().flat_map(|i| i.3).sum::<f64>().max(LEAST);
    let mut sum = [0.0; W];
    while let Some((piece, t0, t1, coarse)) = open.pop() {
        let middle = 0.5 * (t0 + t1);
        let (left, right) = (gauss(piece, t0, middle), gauss(piece, middle, t1));
        let change: f64 = (0..W).map(|k| (left[k] + right[k] - coarse[k]).abs()).sum();
        if change > fineness.change * whole {
            open.push((piece, t0, middle, left));
            open.push((piece, middle, t1, right));
        } else {
            sum = std::array::from_fn(|k| sum[k] + left[k] + right[k]);
        }
    }
    sum
}

/// A ball of glass in air.
pub struct Ball {
    pub centre: Point3,
    pub radius: f64,
    pub n: f64,
}

/// Words of a ball that are followed: R, then T Rᵏ T for k from 0.
pub const BALL_WORDS: usize = 7;

/// a + b cos φ + c sin φ.
type Circular = [f64; 3];

fn at(f: &Circular, phi: f64) -> f64 {
    f[0] + f[1] * phi.cos() + f[2] * phi.sin()
}

/// ∫ f dφ over where all of `bounds` are positive.
fn within(f: &Circular, bounds: &[Circular; 6]) -> Within<1> {
    let mut breaks = vec![(0.0, 6)];
    for ([a, b, c], which) in bounds.iter().zip(0..) {
        let h = b.hypot(*c);
        if a.abs() < h {
            let (middle, half) = (c.atan2(*b), (-a / h).acos());
            breaks.extend([middle - half, middle + half].map(|phi| (phi.rem_euclid(TAU), which)));
        }
    }
    breaks.sort_by(|a, b| a.0.total_cmp(&b.0));
    breaks.push((TAU, 6));
    let (mut cuts, mut sum) = (0u64, 0.0);
    for pair in breaks.windows(2) {
        let ((p, from), (q, to)) = (pair[0], pair[1]);
        if bounds.iter().all(|b| at(b, 0.5 * (p + q)) > 0.0) {
            cuts = cuts.wrapping_mul(64) + 7 * from + to + 1;
            sum += f[0] * (q - p) + f[1] * (q.sin() - p.sin()) - f[2] * (q.cos() - p.cos());
        }
    }
    (cuts, [sum])
}

/// Irradiance at `p` facing `normal` by each word of a ball; ball and lamp must have nothing else in
/// their way.
pub fn through_ball(
    ball: &Ball,
    lamp: &Lamp,
    p: &Point3,
    normal: &Vector3,
    fineness: Fineness,
) -> [f64; BALL_WORDS] {
    let (n, radius) = (ball.n, ball.radius);
    let distance = (ball.centre - p).norm();
    let axis = (ball.centre - p) / distance;
    // φ counts from u to v.
    let u = axis.cross(&Vector3::new(0.3, 0.5, 0.8)).normalize();
    let v = axis.cross(&u);
    let edges = lamp.edges(p);
    let facing = lamp.normal();
    assert!(facing.dot(&(ball.centre - lamp.corners[0])) > radius, "the ball is before the lamp");
    let looks: Vec<f64> = (0..=fineness.looks)
        .map(|k| FRAC_PI_2 * f64::from(k) / f64::from(fineness.looks))
        .collect();
    integral(&looks, fineness, |i| {
        // In the half plane of the axis and φ: along the axis, away from it.
        let (sin_i, cos_i) = i.sin_cos();
        let cos_t = (1.0 - (sin_i / n).powi(2)).sqrt();
        let sin_a = radius / distance * sin_i;
        let cos_a = (1.0 - sin_a * sin_a).sqrt();
        let reach = distance * cos_a - radius * cos_i;
        let mut x = [reach * cos_a, reach * sin_a];
        let outward = |x: &[f64; 2]| [(x[0] - distance) / radius, x[1] / radius];
        let add = |a: [f64; 2], s: f64, b: [f64; 2]| [a[0] + s * b[0], a[1] + s * b[1]];
        let rs = (cos_i - n * cos_t) / (cos_i + n * cos_t);
        let rp = (n * cos_i - cos_t) / (n * cos_i + cos_t);
        let fresnel = 0.5 * (rs * rs + rp * rp);
        // dω = sin a da dφ, and cos a da = (R/D) cos i di.
        let scale = (radius / distance).powi(2) * sin_i * cos_i / cos_a;
        let cosine = [cos_a * normal.dot(&axis), sin_a * normal.dot(&u), sin_a * normal.dot(&v)];
        let lit = |x: &[f64; 2], d: &[f64; 2]| {
            let w = x[0] * d[1] - x[1] * d[0];
            let circular = |along: &Vector3, moment: &Vector3| {
                // d = d₀ axis + d₁ e(φ), x × d = w axis × e(φ), axis × u = v, axis × v = −u.
                [
                    d[0] * moment.dot(&axis),
                    d[1] * moment.dot(&u) + w * along.dot(&v),
                    d[1] * moment.dot(&v) - w * along.dot(&u),
                ]
            };
            let [e0, e1, e2, e3] = edges.each_ref().map(|(along, moment)| circular(along, moment));
            let front = circular(&Vector3::zeros(), &-facing);
            within(&cosine, &[e0, e1, e2, e3, front, cosine])
        };
        let start = [cos_a, sin_a];
        let (mut cuts, mut words) = (0, [0.0; BALL_WORDS]);
        let mut follow = |word: usize, throughput: f64, x: &[f64; 2], d: &[f64; 2]| {
            let (by, [integral]) = lit(x, d);
            words[word] = scale * throughput * integral;
            // A sum that differs wherever one word's cuts do (FNV's prime).
            cuts = (cuts ^ by).wrapping_mul(0x0100_0000_01b3);
        };
        follow(0, fresnel, &x, &add(start, 2.0 * cos_i, outward(&x)));
        let mut d = add([cos_a / n, sin_a / n], cos_i / n - cos_t, outward(&x));
        let mut throughput = (1.0 - fresnel) * (1.0 - fresnel);
        for word in 1..BALL_WORDS {
            x = add(x, 2.0 * radius * cos_t, d);
            let normal = outward(&x);
            let left = add([n * d[0], n * d[1]], cos_i - n * cos_t, normal);
            follow(word, throughput, &x, &left);
            d = add(d, -2.0 * cos_t, normal);
            throughput *= fresnel;
        }
        (cuts, words)
    })
}

/// An open cylinder about the y axis from y = 0, a mirror on both sides.
pub struct Ring {
    pub radius: f64,
    pub height: f64,
}

/// Irradiance at (x, 0, z) facing +y by one reflection at the ring.
pub fn by_ring(ring: &Ring, lamp: &Lamp, x: f64, z: f64, fineness: Fineness) -> f64 {
    let p = Point3::new(x, 0.0, z);
    let edges = lamp.edges(&p);
    let facing = lamp.normal();
    let (r, h) = (ring.radius, ring.height);
    // The ring's point that is least before the lamp's plane.
    let least = facing.y.min(0.0) * h - r * facing.x.hypot(facing.z);
    assert!(least > facing.dot(&lamp.corners[0].coords), "the ring is before the lamp");
    assert!(lamp.corners.iter().all(|c| c.y > h), "the lamp is above the ring");
    let outside = x.hypot(z) > r;
    // Evenly around, and again as evenly seen from the receiver: the wall may be near.
    let (own, near) = (z.atan2(x), (x.hypot(z) - r).abs() / (x.hypot(z) + r));
    let mut looks: Vec<f64> = (0..=fineness.looks)
        .map(|k| TAU * (f64::from(k) / f64::from(fineness.looks) - 0.5))
        .flat_map(|a| [a, 2.0 * (near * (0.5 * a).tan()).atan()])
        .map(|a| own + a)
        .collect();
    looks.sort_by(f64::total_cmp);
    let [e] = integral(&looks, fineness, |phi| {
        let out = Vector3::new(phi.cos(), 0.0, phi.sin());
        let there = out * r - p.coords;
        let c = there.dot(&out);
        // From outside the near wall hides the inside of the far one: what is seen rises outwards.
        if outside && c >= 0.0 {
            return (0, [0.0]);
        }
        let back = there - out * (2.0 * c);
        let rho2 = there.norm_squared();
        let up = Vector3::y();
        let (mut low, mut high) = (0.0f64, h);
        let mut by = [0; 2];
        // Where f, a linear function of y, is positive.
        let mut cut = |which: u64, f: &dyn Fn(f64) -> f64| {
            let (at_0, at_h) = (f(0.0), f(h));
            let root = h * at_0 / (at_0 - at_h);
            match (at_0 > 0.0, at_h > 0.0) {
                (true, true) => {}
                (true, false) if root < high => (high, by[1]) = (root, which),
                (false, true) if root > low => (low, by[0]) = (root, which),
                (false, false) => high = -1.0,
                _ => {}
            }
        };
        for (edge, which) in edges.iter().zip(1..) {
            cut(which, &|y| side(edge, &(there + up * y), &(back + up * y)));
        }
        cut(5, &|y| -facing.dot(&(back + up * y)));
        if !outside {
            // Where it crosses the cylinder again it must be above the rim.
            cut(6, &|y| y + y * 2.0 * r * c / rho2 - h);
        }
        if low >= high {
            return (0, [0.0]);
        }
        // ∫ y |c|/(ρ² + y²)² dy: both cosines over the squared distance.
        let sum = 0.5 * c.abs() * (1.0 / (rho2 + low * low) - 1.0 / (rho2 + high * high));
        (1 + 7 * by[0] + by[1], [r * sum])
    });
    e
}
