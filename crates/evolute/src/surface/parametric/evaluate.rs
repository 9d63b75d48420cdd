//! The tape in world space, over numbers and over intervals.

use crate::formula::{Interval, Jet1, Jet2, Scalar, Tape};
use crate::geometry::{Point3, Transform, Vector3};
use crate::surface::Jet;

/// A tape with outputs x, y, z of (s, t) and the map from there to the world.
#[derive(Clone, Debug)]
pub(super) struct Evaluator {
    tape: Tape,
    linear: [[f64; 3]; 3],
    translation: [f64; 3],
    /// Whether the map is the identity: then it is not applied.
    identity: bool,
}

/// Position and derivatives over a cell, world frame: each part contains its values at all points of
/// the cell.
pub(super) struct JetBox {
    pub x: [Interval; 3],
    pub xs: [Interval; 3],
    pub xt: [Interval; 3],
    pub xss: [Interval; 3],
    pub xst: [Interval; 3],
    pub xtt: [Interval; 3],
}

impl Evaluator {
    pub fn new(tape: Tape, world_from_object: &Transform) -> Self {
        let l = world_from_object.linear();
        Self {
            tape,
            linear: std::array::from_fn(|i| std::array::from_fn(|j| l[(i, j)])),
            translation: world_from_object.point(&Point3::origin()).coords.into(),
            identity: *world_from_object == Transform::identity(),
        }
    }

    /// The linear part; the same operations in the same order for numbers and intervals, so that the
    /// intervals contain the rounded numbers.
    #[inline]
    fn vector<T: Scalar>(&self, v: [T; 3]) -> [T; 3] {
        if self.identity {
            return v;
        }
        std::array::from_fn(|i| {
            let l = &self.linear[i];
            v[0].scaled(l[0]) + v[1].scaled(l[1]) + v[2].scaled(l[2])
        })
    }

    #[inline]
    fn point<T: Scalar>(&self, v: [T; 3]) -> [T; 3] {
        if self.identity {
            return v;
        }
        let w = self.vector(v);
        std::array::from_fn(|i| w[i].shifted(self.translation[i]))
    }

    pub fn position(&self, s: f64, t: f64) -> Point3 {
        Point3::from(self.point(self.tape.evaluate::<f64, 3>(&[s, t])))
    }

    /// Position, x_s and x_t.
    #[inline]
    pub fn jet1(&self, s: f64, t: f64) -> (Point3, Vector3, Vector3) {
        let j = self.tape.evaluate::<Jet1<f64>, 3>(&Jet1::variables(s, t));
        (
            Point3::from(self.point(j.map(|j| j.v))),
            Vector3::from(self.vector(j.map(|j| j.g[0]))),
            Vector3::from(self.vector(j.map(|j| j.g[1]))),
        )
    }

    pub fn jet(&self, s: f64, t: f64) -> Jet {
        let j = self.tape.evaluate::<Jet2<f64>, 3>(&Jet2::variables(s, t));
        Jet {
            x: Point3::from(self.point(j.map(|j| j.v))),
            xu: Vector3::from(self.vector(j.map(|j| j.g[0]))),
            xv: Vector3::from(self.vector(j.map(|j| j.g[1]))),
            xuu: Vector3::from(self.vector(j.map(|j| j.h[0]))),
            xuv: Vector3::from(self.vector(j.map(|j| j.h[1]))),
            xvv: Vector3::from(self.vector(j.map(|j| j.h[2]))),
        }
    }

    pub fn jet_box(&self, [s, t]: [Interval; 2]) -> JetBox {
        let j = self.tape.evaluate::<Jet2<Interval>, 3>(&Jet2::variables(s, t));
        JetBox {
            x: self.point(j.map(|j| j.v)),
            xs: self.vector(j.map(|j| j.g[0])),
            xt: self.vector(j.map(|j| j.g[1])),
            xss: self.vector(j.map(|j| j.h[0])),
            xst: self.vector(j.map(|j| j.h[1])),
            xtt: self.vector(j.map(|j| j.h[2])),
        }
    }

    /// x_s and x_t over a cell.
    pub fn tangent_box(&self, [s, t]: [Interval; 2]) -> [[Interval; 3]; 2] {
        let j = self.tape.evaluate::<Jet1<Interval>, 3>(&Jet1::variables(s, t));
        [0, 1].map(|k| self.vector(j.map(|j| j.g[k])))
    }

    /// Positions over a cell.
    pub fn position_box(&self, cell: [Interval; 2]) -> [Interval; 3] {
        self.point(self.tape.evaluate::<Interval, 3>(&cell))
    }

    /// Whether positions are finite all over the cell: proved if true, open if false.
    pub fn is_finite_on(&self, cell: [Interval; 2]) -> bool {
        self.tape.is_finite_on(&cell) && self.position_box(cell).iter().all(Interval::is_bounded)
    }
}
