//! Surfaces by formulas, and the slow search for them: positions on a grid, boxes around their samples,
//! and quartering within. Uses nothing of the surface but `position`.

use super::Root;
use super::quartering::Chart;
use evolute::formula::Formula;
use evolute::geometry::{Aabb, Point3, Ray, Transform, Vector3};
use evolute::surface::{Parametric, SurfaceError};

pub const WAVE: [&str; 3] =
    ["100*(s-0.5)", "-5*cos(3*pi*(s-0.5))*cos(3*pi*(t-0.5))", "100*(0.5-t)"];
pub const SADDLE: [&str; 3] = ["2*s-1", "2*t-1", "0.8*((2*s-1)^2-(2*t-1)^2)"];
pub const MONKEY: [&str; 3] = ["2*s-1", "2*t-1", "(2*s-1)^3-3*(2*s-1)*(2*t-1)^2"];
pub const SPHERE: [&str; 3] = ["sin(pi*t)*cos(2*pi*s)", "sin(pi*t)*sin(2*pi*s)", "cos(pi*t)"];
pub const TORUS: [&str; 3] =
    ["(2+0.7*cos(2*pi*t))*cos(2*pi*s)", "(2+0.7*cos(2*pi*t))*sin(2*pi*s)", "0.7*sin(2*pi*t)"];
/// A mirror dish: a paraboloid with rim 1 and depth 1/2, polar parameters (a pole at t = 0).
pub const DISH: [&str; 3] = ["t*cos(2*pi*s)", "t*sin(2*pi*s)", "0.5*t^2"];
/// An octant of the sphere over the unit square: both sides that meet at s = 0 collapse.
pub const CORNER: [&str; 3] =
    ["s*cos(pi/2*t)/sqrt(1+s^2)", "s*sin(pi/2*t)/sqrt(1+s^2)", "1/sqrt(1+s^2)"];

pub const SURFACES: [(&str, [&str; 3]); 7] = [
    ("wave", WAVE),
    ("saddle", SADDLE),
    ("monkey saddle", MONKEY),
    ("sphere", SPHERE),
    ("torus", TORUS),
    ("dish", DISH),
    ("corner", CORNER),
];

pub fn build(f: [&str; 3], transform: Transform) -> Result<Parametric, SurfaceError> {
    let [x, y, z] = f.map(|f| Formula::parse(f, &["s", "t"], &[]).unwrap());
    Parametric::new(x, y, z, transform, false)
}

pub fn surface(f: [&str; 3], transform: Transform) -> Parametric {
    build(f, transform).unwrap()
}

/// Turned, stretched and moved.
pub fn somewhere() -> Transform {
    let turn = Transform::rotation(Vector3::new(1.0, 2.0, -0.5), 0.7).unwrap();
    let stretch = Transform::scaling(Vector3::new(1.5, 0.8, -1.1)).unwrap();
    Transform::translation(Vector3::new(3.0, -20.0, 7.0)).after(&turn.after(&stretch))
}

/// Blocks of the grid across the domain.
const GRID: usize = 256;

/// A surface and boxes around blocks of its samples.
pub struct FormulaGrid<'p> {
    surface: &'p Parametric,
    /// Finest first; level k has side length `GRID >> k`.
    levels: Vec<Vec<Aabb>>,
    size: f64,
    reach: f64,
}

impl<'p> FormulaGrid<'p> {
    pub fn new(surface: &'p Parametric) -> Self {
        let n = 2 * GRID + 1;
        let at = |i: usize, j: usize| {
            surface.position(i as f64 / (n - 1) as f64, j as f64 / (n - 1) as f64)
        };
        let x: Vec<Point3> = (0..n * n).map(|k| at(k % n, k / n)).collect();
        let around = Aabb::around(x.iter().copied());
        let (size, reach) =
            (around.diagonal(), around.min.coords.amax().max(around.max.coords.amax()));
        let block = |i: usize, j: usize| {
            let p = |a: usize, b: usize| x[2 * i + a + n * (2 * j + b)];
            let points = (0..9).map(|k| p(k % 3, k / 3));
            let sag = (0..3)
                .flat_map(|k| [[p(0, k), p(1, k), p(2, k)], [p(k, 0), p(k, 1), p(k, 2)]])
                .map(|[a, b, c]| (b - nalgebra::center(&a, &c)).norm())
                .fold(0.0, f64::max);
            Aabb::around(points).grown(2.0 * sag + 1e-12 * (size + reach))
        };
        let finest = (0..GRID * GRID).map(|k| block(k % GRID, k / GRID)).collect();
        let mut levels: Vec<Vec<Aabb>> = vec![finest];
        let mut m = GRID;
        while m > 1 {
            let below = &levels[levels.len() - 1];
            let b = |i: usize, j: usize| below[i + m * j];
            let next = (0..m / 2 * (m / 2))
                .map(|k| (2 * (k % (m / 2)), 2 * (k / (m / 2))))
                .map(|(i, j)| {
                    b(i, j).union(&b(i + 1, j)).union(&b(i, j + 1)).union(&b(i + 1, j + 1))
                })
                .collect();
            levels.push(next);
            m /= 2;
        }
        Self { surface, levels, size, reach }
    }

    /// All roots with t > 0 but for rounding, in no order, some twice.
    pub fn roots(&self, ray: &Ray) -> Vec<Root> {
        let chart = Chart {
            at: |s: f64, t: f64| self.surface.position(s, t),
            triangle: false,
            size: self.size,
            reach: self.reach,
        };
        let mut out = Vec::new();
        let mut waiting = vec![(self.levels.len() - 1, 0, 0)];
        while let Some((level, i, j)) = waiting.pop() {
            let m = GRID >> level;
            if !crosses(&self.levels[level][i + m * j], ray) {
                continue;
            }
            if level > 0 {
                for k in 0..4 {
                    waiting.push((level - 1, 2 * i + k % 2, 2 * j + k / 2));
                }
            } else {
                let h = 0.5 / m as f64;
                let centre = [(2 * i + 1) as f64 * h, (2 * j + 1) as f64 * h];
                chart.search(ray, (centre, [h, h]), &mut out);
            }
        }
        out
    }
}

/// Slab test of the line beyond the origin.
fn crosses(b: &Aabb, ray: &Ray) -> bool {
    let (mut near, mut far) = (0f64, f64::INFINITY);
    for i in 0..3 {
        let (o, d) = (ray.origin[i], ray.direction[i]);
        if d == 0.0 {
            if o < b.min[i] || o > b.max[i] {
                return false;
            }
            continue;
        }
        let (x, y) = ((b.min[i] - o) / d, (b.max[i] - o) / d);
        near = near.max(x.min(y));
        far = far.min(x.max(y));
    }
    near <= far * (1.0 + 1e-12)
}
