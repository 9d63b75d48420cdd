//! Surfaces for random chains, placed wherever a ray is, and a way to meet them that is not the
//! tracer's.

use evolute::formula::Formula;
use evolute::geometry::{Matrix3, Point3, Transform, UnitVector3, Vector3, math, tangent_frame};
use evolute::surface::{
    Cylinder, Disk, LocalGeometry, Parametric, Rectangle, Sphere, Surface, SurfacePoint,
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
    surface: Surface,
    /// Draws parameters (u, v) of a point and how far the surface stays smooth around it, as a
    /// fraction of the surface's size.
    draw: fn(&mut Random) -> (f64, f64, f64),
    /// Parameters of the surface's point under one near it, where Newton's iteration in the parameters
    /// themselves is no good.
    foot: Option<Foot>,
}

type Foot = fn(&Point3) -> (f64, f64);

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

/// One point in five on the corner s = 0 itself, the others at distances from 1e-5 on.
fn towards_the_corner(r: &mut Random) -> (f64, f64, f64) {
    let s = if r.chance(0.2) { 0.0 } else { r.scale(1e-5, 1.0) };
    (s, r.uniform(0.1, 0.9), 0.1)
}

fn polar(x: &Point3) -> (f64, f64) {
    ((x.x * x.x + x.y * x.y).sqrt(), math::atan2(x.y, x.x))
}

fn formula(name: &'static str, xyz: [&str; 3], draw: fn(&mut Random) -> (f64, f64, f64)) -> Body {
    let [x, y, z] = xyz.map(|text| Formula::parse(text, &["s", "t"], &[]).unwrap());
    let surface = Parametric::new(x, y, z, Transform::identity(), false).unwrap();
    Body { name, surface: Surface::Parametric(surface), draw, foot: None }
}

fn closed(name: &'static str, surface: Surface) -> Body {
    Body { name, surface, draw: anywhere, foot: None }
}

/// One of every smooth kind.
pub fn all_bodies() -> Vec<Body> {
    let id = Transform::identity();
    let axis = Vector3::z() * 0.5;
    let ends = [Point3::from(-axis), Point3::from(axis)];
    vec![
        closed("rectangle", Surface::Rectangle(Rectangle::new(id, false).unwrap())),
        closed("disk", Surface::Disk(Disk::new(id, false).unwrap())),
        closed("sphere", Surface::Sphere(Sphere::new(Point3::origin(), 1.0, id, false).unwrap())),
        closed(
            "cylinder",
            Surface::Cylinder(Cylinder::new(ends[0], ends[1], 1.0, id, false).unwrap()),
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
        // A sector whose side s = 0 is a single point, smooth though x_t vanishes there.
        Body {
            foot: Some(polar),
            ..formula(
                "corner",
                ["s*cos(t)", "s*sin(t)", "0.5*s^2*(1 + 0.4*cos(3*t)*s)"],
                towards_the_corner,
            )
        },
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
        let (inside, m) = body.at(u, v)?;
        let (a, b) = tangent_frame(&m);
        let (s, t) = tangent_frame(&n);
        let (sin, cos) = math::sin_cos(r.uniform(0.0, std::f64::consts::TAU));
        let to = Matrix3::from_columns(&[s * cos + t * sin, t * cos - s * sin, n.into_inner()]);
        let from = Matrix3::from_columns(&[a, b, m.into_inner()]);
        Some(Self {
            body,
            uv: (u, v),
            inside,
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
    /// Point and normal.
    fn at(&self, u: f64, v: f64) -> Option<(Point3, UnitVector3)> {
        let local = match &self.surface {
            Surface::Parametric(p) => p.local(u, v)?,
            surface => surface.local(&surface.point(u, v)?)?,
        };
        Some((local.x, local.n))
    }

    /// The intersection nearest to the ray parameter `near`, on the surface continued past its border.
    fn meet(
        &self,
        o: &Point3,
        d: &Vector3,
        near: f64,
        uv: (f64, f64),
    ) -> Option<(f64, LocalGeometry)> {
        let flat = |v: &Vector3| Vector3::new(v.x, v.y, 0.0);
        let t = match &self.surface {
            Surface::Rectangle(_) | Surface::Disk(_) => -o.z / d.z,
            Surface::Sphere(_) => nearest_root(&o.coords, d, near)?,
            Surface::Cylinder(_) => nearest_root(&flat(&o.coords), &flat(d), near)?,
            Surface::Parametric(p) => {
                let (u, v, t) = match self.foot {
                    None => newton(p, o, d, uv, near)?,
                    Some(foot) => plane_by_plane(p, o, d, foot, near)?,
                };
                let mut local = p.local(u, v)?;
                // Close to the corner, finite differences need more digits of the normal than the
                // library's limit has.
                if let Some(n) = p.jet(u, v).normal().filter(|_| u > 0.0) {
                    local.n = if n.dot(&local.n) < 0.0 { -n } else { n };
                }
                return Some((t, local));
            }
            Surface::Mesh(_) => return None,
        };
        let at = SurfacePoint { primitive: 0, p: 0.0, q: 0.0, x: o + d * t };
        Some((t, self.surface.local(&at)?))
    }
}

/// Newton's iteration on x(u, v) = o + t d from a start nearby.
fn newton(
    surface: &Parametric,
    o: &Point3,
    d: &Vector3,
    uv: (f64, f64),
    t: f64,
) -> Option<(f64, f64, f64)> {
    let ((mut u, mut v), mut t) = (uv, t);
    for _ in 0..20 {
        let jet = surface.jet(u, v);
        let columns = Matrix3::from_columns(&[jet.xu, jet.xv, -d]);
        let step = columns.try_inverse()? * (o + d * t - jet.x);
        (u, v, t) = (u + step.x, v + step.y, t + step.z);
        // Squares of this are below rounding.
        if step.norm() < 1e-9 {
            return Some((u, v, t));
        }
    }
    None
}

/// The same where the surface is a graph over its xy plane: the ray against one tangent plane after
/// the other.
fn plane_by_plane(
    surface: &Parametric,
    o: &Point3,
    d: &Vector3,
    foot: Foot,
    mut t: f64,
) -> Option<(f64, f64, f64)> {
    for _ in 0..20 {
        let (u, v) = foot(&(o + d * t));
        let jet = surface.jet(u, v);
        let n = jet.normal().or_else(|| Some(surface.local(u, v)?.n))?;
        let next = n.dot(&(jet.x - o)) / n.dot(d);
        let step = next - t;
        t = next;
        if step.abs() < 1e-9 {
            let (u, v) = foot(&(o + d * t));
            return Some((u, v, t));
        }
    }
    None
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
