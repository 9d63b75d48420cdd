//! The first triangles of a surface: roughly equal in space, neighbours by common vertices.

use super::mesh::area;
use crate::geometry::{Point3, math};
use crate::surface::{ChartPoint, Mesh, Surface, contact_tolerance, sphere_charts};

/// A triangle of a chart. Triangles with the same vertex share its light.
#[derive(Clone, Debug, PartialEq)]
pub struct Root {
    pub chart: u32,
    pub vertices: [u32; 3],
    /// Counter-clockwise in the chart.
    pub corners: [[f64; 2]; 3],
}

/// The first triangles, and how they are found.
#[derive(Clone, Debug)]
pub struct Roots {
    triangles: Vec<Root>,
    finder: Finder,
}

/// How the root at a point is found.
#[derive(Clone, Debug)]
enum Finder {
    /// One for each chart, in order.
    Charts,
    /// Two for each cell of a lattice, row by row.
    Lattice { min: [f64; 2], cells_per_unit: [f64; 2], size: [usize; 2] },
    /// A few, all in one chart.
    All,
}

/// Most columns or rows of first triangles: beyond this, memory is the user's problem to be told of.
const MOST: usize = 2048;

impl Roots {
    /// Triangles with sides of about `edge` [m]; of spheres and meshes their faces, of any size.
    pub fn new(surface: &Surface, edge: f64) -> Self {
        let (triangles, finder) = match surface {
            Surface::Sphere(_) => (sphere(), Finder::Charts),
            Surface::Mesh(m) => (facets(m), Finder::Charts),
            Surface::Disk(_) => (disk(), Finder::All),
            _ => Lattice::of(surface).triangles(surface, edge),
        };
        Self { triangles, finder }
    }

    pub fn triangles(&self) -> &[Root] {
        &self.triangles
    }

    /// The root that contains a point; that which misses it least if rounding leaves none.
    pub fn locate(&self, point: &ChartPoint) -> u32 {
        match &self.finder {
            Finder::Charts => point.chart,
            Finder::Lattice { min, cells_per_unit, size } => {
                let mut cell = [0; 2];
                let mut within = [0.0; 2];
                for k in 0..2 {
                    let x = (point.at[k] - min[k]) * cells_per_unit[k];
                    cell[k] = (x.max(0.0) as usize).min(size[k] - 1);
                    within[k] = x - cell[k] as f64;
                }
                let ([i, j], [u, v]) = (cell, within);
                let second = if is_rising(i, j) { u < v } else { u + v > 1.0 };
                (2 * (j * size[0] + i) + usize::from(second)) as u32
            }
            Finder::All => {
                let depth = |r: &u32| self.triangles[*r as usize].depth(point.at);
                // Of equals the first.
                (0..self.triangles.len() as u32)
                    .reduce(|a, b| if depth(&b) > depth(&a) { b } else { a })
                    .unwrap_or(0)
            }
        }
    }
}

/// Which way the diagonal of a lattice's cell runs. They alternate, so that no direction is preferred.
fn is_rising(i: usize, j: usize) -> bool {
    (i + j).is_multiple_of(2)
}

impl Root {
    /// The least of the three weights of a point.
    fn depth(&self, at: [f64; 2]) -> f64 {
        let [a, b, c] = self.corners;
        area(a, b, at).min(area(b, c, at)).min(area(c, a, at)) / area(a, b, c)
    }
}

/// The rectangle of a chart that is cut into a lattice.
struct Lattice {
    min: [f64; 2],
    max: [f64; 2],
}

impl Lattice {
    fn of(surface: &Surface) -> Self {
        match surface {
            Surface::Rectangle(_) => Self { min: [-1.0; 2], max: [1.0; 2] },
            _ => Self { min: [0.0; 2], max: [1.0; 2] },
        }
    }

    /// Two triangles for each cell, cells about `edge` [m] wide and high.
    fn triangles(&self, surface: &Surface, edge: f64) -> (Vec<Root>, Finder) {
        let place = |i: f64, j: f64| {
            let at = [0, 1].map(|k| self.min[k] + [i, j][k] * (self.max[k] - self.min[k]));
            ChartPoint { chart: 0, at }
        };
        let at = |i: f64, j: f64| surface.at_chart(&place(i, j)).x;
        // Longest of a few lines across, by chords.
        const LINES: usize = 8;
        const CHORDS: usize = 32;
        let lengths = [0, 1].map(|k| {
            (0..=LINES)
                .map(|line| {
                    let fixed = line as f64 / LINES as f64;
                    let point = |n: usize| {
                        let x = n as f64 / CHORDS as f64;
                        if k == 0 { at(x, fixed) } else { at(fixed, x) }
                    };
                    (0..CHORDS).map(|n| (point(n + 1) - point(n)).norm()).sum::<f64>()
                })
                .fold(0.0, f64::max)
        });
        // Three at least where the sheet may close: no two edges then have the same two ends.
        let fewest = if matches!(surface, Surface::Rectangle(_)) { 1 } else { 3 };
        let count = lengths.map(|l| ((l / edge).ceil().min(MOST as f64) as usize).max(fewest));
        let [columns, rows] = count;
        let number = |i: usize, j: usize| j * (columns + 1) + i;
        let fraction = |i: usize, n: usize| i as f64 / n as f64;
        let mut points = Vec::with_capacity((columns + 1) * (rows + 1));
        for j in 0..=rows {
            for i in 0..=columns {
                points.push(at(fraction(i, columns), fraction(j, rows)));
            }
        }
        let on_border = |n: usize| {
            let (i, j) = (n % (columns + 1), n / (columns + 1));
            i == 0 || j == 0 || i == columns || j == rows
        };
        let vertices = match surface {
            Surface::Rectangle(_) => (0..points.len() as u32).collect(),
            _ => welded(&points, on_border, surface),
        };
        let mut roots = Vec::with_capacity(2 * columns * rows);
        for j in 0..rows {
            for i in 0..columns {
                let square = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                let halves =
                    if is_rising(i, j) { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] };
                for half in halves {
                    let corners = half.map(|c: usize| square[c]);
                    roots.push(Root {
                        chart: 0,
                        vertices: corners.map(|(i, j)| vertices[number(i, j)]),
                        corners: corners
                            .map(|(i, j)| place(fraction(i, columns), fraction(j, rows)).at),
                    });
                }
            }
        }
        let cells_per_unit = [0, 1].map(|k| count[k] as f64 / (self.max[k] - self.min[k]));
        (roots, Finder::Lattice { min: self.min, cells_per_unit, size: count })
    }
}

/// Vertex numbers of points: one for all points of a border that coincide, as at a seam or a pole.
fn welded(points: &[Point3], on_border: impl Fn(usize) -> bool, surface: &Surface) -> Vec<u32> {
    let bounds = surface.bounds();
    let mut border: Vec<usize> = (0..points.len()).filter(|&n| on_border(n)).collect();
    // By place along an axis: what coincides is near each other.
    border.sort_by(|&a, &b| points[a].x.total_cmp(&points[b].x).then(a.cmp(&b)));
    let mut like: Vec<usize> = (0..points.len()).collect();
    for (k, &a) in border.iter().enumerate() {
        if like[a] != a {
            continue;
        }
        // Formulas agree at a seam to their own rounding, which is more than that of a contact.
        let tolerance = 64.0 * contact_tolerance(&points[a], &bounds);
        for &b in &border[k + 1..] {
            if points[b].x - points[a].x > tolerance {
                break;
            }
            if like[b] == b && (points[b] - points[a]).norm() <= tolerance {
                like[b] = a;
            }
        }
    }
    // The lowest of a group gives the number.
    let mut least = like.clone();
    for (n, &group) in like.iter().enumerate() {
        least[group] = least[group].min(n);
    }
    let mut number = vec![u32::MAX; points.len()];
    let mut next = 0;
    for n in 0..points.len() {
        let first = least[like[n]];
        if number[first] == u32::MAX {
            number[first] = next;
            next += 1;
        }
        number[n] = number[first];
    }
    number
}

/// A hexagon; the rim comes when its edges are cut.
fn disk() -> Vec<Root> {
    let corner = |i: u32| {
        let (s, c) = math::sin_cos(f64::from(i % 6) * std::f64::consts::TAU / 6.0);
        [c, s]
    };
    (0..6)
        .map(|i| Root {
            chart: 0,
            vertices: [0, 1 + i, 1 + (i + 1) % 6],
            corners: [[0.0; 2], corner(i), corner(i + 1)],
        })
        .collect()
}

/// The corners of a triangle in a chart of its own.
const OWN_CHART: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

fn sphere() -> Vec<Root> {
    (0u32..)
        .zip(sphere_charts())
        .map(|(chart, &vertices)| Root { chart, vertices, corners: OWN_CHART })
        .collect()
}

/// Cosine of the angle between facets (without vertex normals) up to which they are one face.
const FLAT: f64 = 1.0 - 1e-9;

/// The facets of a mesh. A vertex is shared by facets around it that go on smoothly from one to the next:
/// by the same normals at both ends of their edge, or in one plane.
fn facets(mesh: &Mesh) -> Vec<Root> {
    let triangles = mesh.triangles();
    // Vertices at the same place count as one, and have one number for each smooth part around them.
    let mut places: Vec<usize> = (0..mesh.positions().len()).collect();
    let key = |&v: &usize| mesh.positions()[v].coords.map(f64::to_bits);
    places.sort_by_key(|v| (<[u64; 3]>::from(key(v)), *v));
    let mut place = vec![0; places.len()];
    for group in places.chunk_by(|a, b| key(a) == key(b)) {
        for &v in group {
            place[v] = group[0];
        }
    }
    let mut edges: Vec<([usize; 2], usize, usize)> = Vec::new();
    for (t, corners) in triangles.iter().enumerate() {
        for e in 0..3 {
            let ends = [corners[e], corners[(e + 1) % 3]].map(|v| place[v as usize]);
            edges.push(([ends[0].min(ends[1]), ends[0].max(ends[1])], t, e));
        }
    }
    edges.sort_unstable();
    let mut parts = Parts::new(3 * triangles.len());
    for group in edges.chunk_by(|a, b| a.0 == b.0) {
        let [(_, t, e), (_, u, f)] = *group else { continue };
        // The same two corners in the other order.
        let pairs = [(e, (f + 1) % 3), ((e + 1) % 3, f)];
        let corner = |t: usize, c: usize| triangles[t][c] as usize;
        if pairs.iter().all(|&(c, d)| place[corner(t, c)] == place[corner(u, d)])
            && (goes_on_flat(mesh, t, u)
                || pairs.iter().all(|&(c, d)| same_normal(mesh, corner(t, c), corner(u, d))))
        {
            for (c, d) in pairs {
                parts.join(3 * t + c, 3 * u + d);
            }
        }
    }
    let mut number = vec![u32::MAX; 3 * triangles.len()];
    let mut next = 0;
    (0..triangles.len())
        .map(|t| {
            let vertices = [0, 1, 2].map(|c| {
                let part = parts.of(3 * t + c);
                if number[part] == u32::MAX {
                    number[part] = next;
                    next += 1;
                }
                number[part]
            });
            Root { chart: t as u32, vertices, corners: OWN_CHART }
        })
        .collect()
}

/// Whether two facets of a mesh without curved patches lie in one plane, and face the same side.
fn goes_on_flat(mesh: &Mesh, t: usize, u: usize) -> bool {
    let [a, b] = [t, u].map(|i| mesh.area_vector(i as u32).try_normalize(0.0));
    !mesh.is_smooth() && a.zip(b).is_some_and(|(a, b)| a.dot(&b) > FLAT)
}

/// Whether a smooth mesh has the same normal at two of its vertices.
fn same_normal(mesh: &Mesh, v: usize, w: usize) -> bool {
    mesh.is_smooth() && mesh.normals().is_some_and(|n| v == w || n[v] == n[w])
}

/// Disjoint sets, each named by its lowest member.
struct Parts(Vec<usize>);

impl Parts {
    fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    fn of(&mut self, i: usize) -> usize {
        let mut root = i;
        while self.0[root] != root {
            root = self.0[root];
        }
        let mut i = i;
        while self.0[i] != root {
            i = std::mem::replace(&mut self.0[i], root);
        }
        root
    }

    fn join(&mut self, i: usize, j: usize) {
        let (a, b) = (self.of(i), self.of(j));
        self.0[a.max(b)] = a.min(b);
    }
}
