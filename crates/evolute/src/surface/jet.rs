//! The second-order Taylor data of a surface at a point, and what differential geometry reads off it.

use crate::geometry::{Matrix2, Matrix3, Point3, UnitVector3, Vector2, Vector3};

/// Position and derivatives of a surface `x(u, v)` up to second order, world frame [m per unit
/// of parameter].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// Position [m].
    pub x: Point3,
    /// ∂x/∂u.
    pub xu: Vector3,
    /// ∂x/∂v.
    pub xv: Vector3,
    /// ∂²x/∂u².
    pub xuu: Vector3,
    /// ∂²x/∂u∂v.
    pub xuv: Vector3,
    /// ∂²x/∂v².
    pub xvv: Vector3,
}

/// Principal curvatures κ [1/m] of a surface with respect to a normal N (positive where the surface
/// bends towards N) and their directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipalCurvatures {
    /// The curvatures, the larger first [1/m].
    pub kappa: [f64; 2],
    /// Unit tangent vectors, orthogonal; any pair at an umbilic.
    pub directions: [Vector3; 2],
}

/// What optics needs of a surface at a hit: where, which way it faces, and how the normal turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalGeometry {
    /// The point [m].
    pub x: Point3,
    /// The unit normal, on the side that the shape calls its front (shading normal on meshes with
    /// vertex normals).
    pub n: UnitVector3,
    /// The unit normal of the geometry itself; equals `n` but on meshes with vertex normals.
    pub ng: UnitVector3,
    /// Derivative of `n` along a tangential displacement [1/m]: `dN = dn_dx · dx`. Symmetric for true
    /// surfaces, not for interpolated normals.
    pub dn_dx: Matrix3,
}

impl Jet {
    /// E, F, G of the first fundamental form [m²].
    pub fn first_form(&self) -> Matrix2 {
        let f = self.xu.dot(&self.xv);
        Matrix2::new(self.xu.norm_squared(), f, f, self.xv.norm_squared())
    }

    /// e, f, g of the second fundamental form [m] with respect to the unit normal `n`.
    pub fn second_form(&self, n: &UnitVector3) -> Matrix2 {
        let f = self.xuv.dot(n);
        Matrix2::new(self.xuu.dot(n), f, f, self.xvv.dot(n))
    }

    /// `x_u × x_v` [m²]: area per unit of parameter area, on the parametrisation's own side.
    pub fn area_vector(&self) -> Vector3 {
        self.xu.cross(&self.xv)
    }

    /// The unit normal on the parametrisation's side; `None` where x_u and x_v are parallel.
    pub fn normal(&self) -> Option<UnitVector3> {
        UnitVector3::try_new(self.area_vector(), 0.0).filter(|n| n.iter().all(|x| x.is_finite()))
    }

    /// Derivatives of the unit normal along u and v (Weingarten's equations); `None` where the
    /// parametrisation is singular.
    pub fn normal_derivatives(&self, n: &UnitVector3) -> Option<(Vector3, Vector3)> {
        let w = self.first_form().try_inverse()? * self.second_form(n);
        Some((
            -(self.xu * w[(0, 0)] + self.xv * w[(1, 0)]),
            -(self.xu * w[(0, 1)] + self.xv * w[(1, 1)]),
        ))
    }

    /// Parameters' change (u̇, v̇) for a tangential displacement `dx` [m].
    pub fn parameters_along(&self, dx: &Vector3) -> Option<Vector2> {
        let rhs = Vector2::new(self.xu.dot(dx), self.xv.dot(dx));
        Some(self.first_form().try_inverse()? * rhs)
    }

    /// Local geometry with the normal on the parametrisation's side (`flip` = false) or the other;
    /// `None` where the parametrisation is singular.
    pub fn local(&self, flip: bool) -> Option<LocalGeometry> {
        let n = self.normal()?;
        let n = if flip { -n } else { n };
        let inverse = self.first_form().try_inverse()?;
        let w = inverse * self.second_form(&n) * inverse;
        let (a, b) = (&self.xu, &self.xv);
        let dn_dx = -(a * a.transpose() * w[(0, 0)]
            + (a * b.transpose() + b * a.transpose()) * w[(0, 1)]
            + b * b.transpose() * w[(1, 1)]);
        Some(LocalGeometry { x: self.x, n, ng: n, dn_dx })
    }
}

impl LocalGeometry {
    /// Principal curvatures with respect to `n`, of the symmetric part of the normal's derivative.
    pub fn principal_curvatures(&self) -> PrincipalCurvatures {
        let (s, t) = crate::geometry::tangent_frame(&self.n);
        let off = -0.5 * (s.dot(&(self.dn_dx * t)) + t.dot(&(self.dn_dx * s)));
        let form = Matrix2::new(-s.dot(&(self.dn_dx * s)), off, off, -t.dot(&(self.dn_dx * t)));
        let eigen = form.symmetric_eigen();
        let direction = |i: usize| {
            let c = eigen.eigenvectors.column(i);
            s * c[0] + t * c[1]
        };
        let (i, j) = if eigen.eigenvalues[0] >= eigen.eigenvalues[1] { (0, 1) } else { (1, 0) };
        PrincipalCurvatures {
            kappa: [eigen.eigenvalues[i], eigen.eigenvalues[j]],
            directions: [direction(i), direction(j)],
        }
    }
}
