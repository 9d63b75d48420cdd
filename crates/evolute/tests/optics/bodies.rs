//! Surfaces for random chains, placed wherever a ray is, and a way to meet them that is not the
//! tracer's.

use evolute::formula::{Formula, Jet2, Tape};
use evolute::geometry::{Matrix3, Point3, Transform, UnitVector3, Vector3, math, tangent_frame};
use evolute::surface::{
    Cylinder, Disk, Jet, LocalGeometry, Rectangle, Sphere, Surface, SurfacePoint,
};

/// A fixed stream of numbers (SplitMix64; Steele, Lea & Flood 2014).
pub struct Random(pub u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn uniform(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * ((self.bits() >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// Uniform in the logarithm.
    pub fn scale(&mut self, from: f64, to: f64) -> f64 {
        math::exp(self.uniform(math::log(from), math::log(to)))
    }

    pub fn chance(&mut self, p: f64) -> bool {
        self.uniform(0.0, 1.0) < p
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    pub fn direction(&mut self) -> UnitVector3 {
        let z = self.uniform(-1.0, 1.0);
        let (s, c) = math::sin_cos(self.uniform(0.0, std::f64::consts::TAU));
        let r = (1.0 - z * z).sqrt();
        UnitVector3::new_normalize(Vector3::new(r * c, r * s, z))
    }
}

/// A surface of size one about the origin of its own frame.
pub struct Body {
    pub name: &'static str,
    shape: Shape,
    /// Draws parameters (u, v) of a point and how far the surface stays smooth around it, as a
    /// fraction of the surface's size.
    draw: fn(&mut Random) -> (f64, f64, f64),
}

enum Shape {
    Surface(Surface),
    Formula(Tape),
}

/// Inside the border, anywhere.
fn anywhere(r: &mut Random) -> (f64, f64, f64) {
    (r.uniform(0.05, 0.95), r.uniform(0.05, 0.95), 0.05)
}

/// Half of the points on the umbilic at the centre itself, half close by or further off.
fn at_the_umbilic(r: &mut Random) -> (f64, f64, f64) {
    let off = if r.chance(0.5) { 0.0 } else { r.scale(1e-8, 0.4) };
    let (s, c) = math::sin_cos(r.uniform(0.0, 6.3));
    (0.5 + off * c, 0.5 + off * s, 0.1)
}

/// Distances from the corner s = 0 from 1e-3 on.
fn towards_the_corner(r: &mut Random) -> (f64, f64, f64) {
    let s = r.scale(1e-3, 1.0);
    (s, r.uniform(0.1, 0.9), 0.3 * s)
}

fn formula(name: &'static str, xyz: [&str; 3], draw: fn(&mut Random) -> (f64, f64, f64)) -> Body {
    let parsed = xyz.map(|text| Formula::parse(text, &["s", "t"], &[]).unwrap());
    Body { name, shape: Shape::Formula(Tape::compile(&parsed).unwrap()), draw }
}

fn closed(name: &'static str, surface: Surface) -> Body {
    Body { name, shape: Shape::Surface(surface), draw: anywhere }
}

/// One of every smooth kind.
pub fn all_bodies() -> Vec<Body> {
    let id = Transform::identity();
    let axis = Vector3::z() * 0.5;
    vec![
        closed("rectangle", Surface::Rectangle(Rectangle::new(id, false).unwrap())),
        closed("disk", Surface::Disk(Disk::new(id, false).unwrap())),
        closed("sphere", Surface::Sphere(Sphere::new(Point3::origin(), 1.0, id, false).unwrap())),
        closed(
            "cylinder",
            Surface::Cylinder(
                Cylinder::new(Point3::from(-axis), Point3::from(axis), 1.0, id, false).unwrap(),
            ),
        ),
        formula("wave", ["2*s - 1", "0.12*sin(7*s)*cos(5*t)", "1 - 2*t"], anywhere),
        // z = (x² + y²)/2 + a cubic: equal principal curvatures at the centre only.
        formula(
            "umbilic",
            [
                "2*s - 1",
                "2*t - 1",
                "((2*s-1)^2 + (2*t-1)^2)/2 + 0.2*((2*s-1)^3 - 3*(2*s-1)*(2*t-1)^2)",
            ],
            at_the_umbilic,
        ),
        formula("saddle", ["2*s - 1", "2*t - 1", "0.8*(2*s - 1)*(2*t - 1)"], anywhere),
        // The side s = 0 is a single point.
        formula(
            "corner",
            ["s*cos(t)", "s*sin(t)", "0.5*s^2*(1 + 0.4*cos(3*t)*s)"],
            towards_the_corner,
        ),
    ]
}

/// A body turned, scaled and moved so that its chosen point lies where a chain needs it.
pub struct Placed<'b> {
    body: &'b Body,
    uv: (f64, f64),
    /// The point in the body's frame and in the world.
    inside: Point3,
    world: Point3,
    rotation: Matrix3,
    scale: f64,
    /// Distance within which the surface is smooth [m].
    pub smooth: f64,
}

impl<'b> Placed<'b> {
    /// A random point of the body at `x` with its normal along `n`.
    pub fn new(
        body: &'b Body,
        scale: f64,
        x: Point3,
        n: UnitVector3,
        r: &mut Random,
    ) -> Option<Self> {
        let (u, v, smooth) = (body.draw)(r);
        let jet = body.jet(u, v)?;
        let m = jet.normal()?;
        let (a, b) = tangent_frame(&m);
        let (s, t) = tangent_frame(&n);
        let (sin, cos) = math::sin_cos(r.uniform(0.0, std::f64::consts::TAU));
        let to = Matrix3::from_columns(&[s * cos + t * sin, t * cos - s * sin, n.into_inner()]);
        let from = Matrix3::from_columns(&[a, b, m.into_inner()]);
        Some(Self {
            body,
            uv: (u, v),
            inside: jet.x,
            world: x,
            rotation: to * from.transpose(),
            scale,
            smooth: smooth * scale,
        })
    }

    /// Where the line from `o` along `d` meets the surface next to the chosen point: distance and
    /// local geometry in the world.
    pub fn meet(&self, o: &Point3, d: &UnitVector3) -> Option<(f64, LocalGeometry)> {
        let origin = self.inside + self.rotation.transpose() * (o - self.world) / self.scale;
        let direction = self.rotation.transpose() * d.into_inner();
        let near = (self.inside - origin).dot(&direction);
        let (t, local) = self.body.meet(&origin, &direction, near, self.uv)?;
        let n = UnitVector3::new_normalize(self.rotation * local.n.into_inner());
        let t = t * self.scale;
        let dn_dx = self.rotation * local.dn_dx * self.rotation.transpose() / self.scale;
        Some((t, LocalGeometry { x: o + d.into_inner() * t, n, ng: n, dn_dx }))
    }
}

impl Body {
    fn jet(&self, u: f64, v: f64) -> Option<Jet> {
        match &self.shape {
            Shape::Surface(s) => s.jet(u, v),
            Shape::Formula(tape) => {
                let [x, y, z] = tape.evaluate::<Jet2<f64>, 3>(&Jet2::variables(u, v));
                let vector = |f: fn(&Jet2<f64>) -> f64| Vector3::new(f(&x), f(&y), f(&z));
                Some(Jet {
                    x: Point3::new(x.v, y.v, z.v),
                    xu: vector(|j| j.g[0]),
                    xv: vector(|j| j.g[1]),
                    xuu: vector(|j| j.h[0]),
                    xuv: vector(|j| j.h[1]),
                    xvv: vector(|j| j.h[2]),
                })
            }
        }
    }

    /// The intersection nearest to the ray parameter `near`, on the surface continued past its border.
    fn meet(
        &self,
        o: &Point3,
        d: &Vector3,
        near: f64,
        uv: (f64, f64),
    ) -> Option<(f64, LocalGeometry)> {
        let at = |t: f64| SurfacePoint { primitive: 0, p: 0.0, q: 0.0, x: o + d * t };
        match &self.shape {
            Shape::Surface(surface) => {
                let t = match surface {
                    Surface::Rectangle(_) | Surface::Disk(_) => -o.z / d.z,
                    Surface::Sphere(_) => nearest_root(&o.coords, d, near)?,
                    _ => {
                        let flat = |v: &Vector3| Vector3::new(v.x, v.y, 0.0);
                        nearest_root(&flat(&o.coords), &flat(d), near)?
                    }
                };
                Some((t, surface.local(&at(t))?))
            }
            Shape::Formula(_) => {
                // Newton's iteration on x(u, v) = o + t d.
                let (mut u, mut v, mut t) = (uv.0, uv.1, near);
                for _ in 0..20 {
                    let jet = self.jet(u, v)?;
                    let step = Matrix3::from_columns(&[jet.xu, jet.xv, -d]).try_inverse()?
                        * (o + d * t - jet.x);
                    (u, v, t) = (u + step.x, v + step.y, t + step.z);
                    // One more step squares this away.
                    if step.x.abs() < 1e-8 * u.abs() && step.y.abs() < 1e-8 {
                        let jet = self.jet(u, v)?;
                        let last = Matrix3::from_columns(&[jet.xu, jet.xv, -d]).try_inverse()?
                            * (o + d * t - jet.x);
                        let (u, v, t) = (u + last.x, v + last.y, t + last.z);
                        return Some((t, self.jet(u, v)?.local(false)?));
                    }
                }
                None
            }
        }
    }
}

/// The root of |o + t d|² = 1 nearer to `near`.
fn nearest_root(o: &Vector3, d: &Vector3, near: f64) -> Option<f64> {
    let a = d.norm_squared();
    let middle = -o.dot(d) / a;
    let closest = (o + d * middle).norm();
    let half = (1.0 - closest) * (1.0 + closest) / a;
    if half < 0.0 {
        return None;
    }
    let half = half.sqrt();
    Some(if near < middle { middle - half } else { middle + half })
}
