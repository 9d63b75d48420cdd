//! Wavefronts along a ray: transfer, reflection and refraction of the curvature tensor (Yu & Wu 2.1).
//!
//! Near a ray with unit direction d in a medium of index n, a ray through the transverse point y (in
//! a frame e₁, e₂ ⟂ d) has the direction d − K y. K, symmetric, is the curvature tensor, **positive
//! when converging**: its eigenvalues are 1/distance to the foci ahead.
//!
//! **Representation.** K has a pole at each focus, so we carry the ray family itself: with two
//! coordinates q of the family, y = A q and the change of direction is B q; K = −B A⁻¹. Both matrices
//! stay finite and smooth through foci, det A is the signed cross-section of the pencil per unit of
//! q, and AᵀB stays symmetric. A spherical wave starts with A = 0, B = 1 (q in radians), a plane one
//! with A = 1, B = 0 (q in metres). Over a distance t, A becomes A + t B: K' = K/(1 − tK), Yu & Wu (1).
//!
//! **Interaction.** Let N be the unit normal (either side) and S the shape operator, so that the
//! normal at the tangential displacement τ is N − Sτ (the surface is ½ τᵀSτ along N). The law of
//! reflection and Snell's law are n₂d₂ − n₁d₁ = γN (`media`). A neighbouring ray meets the surface at
//! τ = Σ y_j τ_j with τ_j = e_j − d₁ (e_j·N)/(d₁·N). Differentiate the law and keep its tangential
//! part, in which δγ drops out: n₂ δd₂ = n₁ δd₁ − γ Sτ. With G_jk = e'_j·τ_k (old → new transverse
//! coordinates: the same point of the surface) this reads
//!
//! ```text
//! A' = G A,    B' = G⁻ᵀ (n₁ B − γ Q A)/n₂,    Q_jk = τ_jᵀ S τ_k,
//! ```
//!
//! or for tensors n₂ GᵀK'G = n₁ K + γ Q. In surface coordinates it is
//! n₂ P₂K₂P₂ᵀ = n₁ P₁K₁P₁ᵀ − (n₁ d₁·N − n₂ d₂·N) S with P_ij = t_i·e_j. N → −N changes the sign of
//! both γ and S: the side does not matter. After a reflection the frame is the mirror image of the
//! frame before (so it changes handedness), after a refraction it is turned in the plane of incidence:
//! G = 1 at a reflection, and det G = cos t/cos i > 0 at a refraction. So det A changes sign at foci and
//! nowhere else.
//!
//! On meshes with vertex normals `LocalGeometry::n` and the symmetric part of its derivative stand for
//! N and S: K stays a curvature tensor, and the law between the two factors holds by construction;
//! against the traced rays it is right to first order in the size of the facets.

use super::media::{reflect_direction, refract_direction, refraction_gamma};
use super::principal::PrincipalWave;
use super::tensor::{adjugate, symmetric_eigenvalues};
use crate::geometry::{Matrix2, UnitVector3, Vector3, tangent_frame};
use crate::surface::LocalGeometry;

/// A thin pencil of rays around a central ray, at a point of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wavefront {
    direction: UnitVector3,
    frame: [Vector3; 2],
    index: f64,
    a: Matrix2,
    b: Matrix2,
}

impl Wavefront {
    /// The spherical wave around a point, at the point itself, in a medium of refractive index
    /// `index`. Coordinates of the family: small angles [rad].
    pub fn spherical(direction: UnitVector3, index: f64) -> Self {
        let (s, t) = tangent_frame(&direction);
        Self { direction, frame: [s, t], index, a: Matrix2::zeros(), b: Matrix2::identity() }
    }

    /// Collimated light (K = 0). Coordinates of the family: transverse position [m].
    pub fn plane(direction: UnitVector3, index: f64) -> Self {
        Self::with_curvature(direction, index, &Matrix2::zeros())
    }

    /// A wave of curvature `k` [1/m] in the frame `tangent_frame(direction)`; only the symmetric part
    /// counts. Coordinates of the family: transverse position [m].
    pub fn with_curvature(direction: UnitVector3, index: f64, k: &Matrix2) -> Self {
        let (s, t) = tangent_frame(&direction);
        let b = -(k + k.transpose()) * 0.5;
        Self { direction, frame: [s, t], index, a: Matrix2::identity(), b }
    }

    /// Direction of the central ray, along the light.
    pub fn direction(&self) -> UnitVector3 {
        self.direction
    }

    /// e₁, e₂: orthonormal, across the direction; left-handed with it after an odd number of
    /// reflections.
    pub fn frame(&self) -> [Vector3; 2] {
        self.frame
    }

    /// Refractive index of the medium.
    pub fn index(&self) -> f64 {
        self.index
    }

    /// A = ∂y/∂q: transverse position in the frame per coordinate of the family.
    pub fn position_jacobian(&self) -> Matrix2 {
        self.a
    }

    /// B: change of direction in the frame [rad] per coordinate of the family.
    pub fn direction_jacobian(&self) -> Matrix2 {
        self.b
    }

    /// For each coordinate of the family the transverse displacement and the change of direction, as
    /// vectors of space: the ray differential across the central ray.
    pub fn ray_derivatives(&self) -> [(Vector3, Vector3); 2] {
        let [e1, e2] = self.frame;
        let column = |m: &Matrix2, k: usize| e1 * m[(0, k)] + e2 * m[(1, k)];
        [0, 1].map(|k| (column(&self.a, k), column(&self.b, k)))
    }

    /// det A: cross-section of the pencil per unit of dq₁dq₂, negative after an odd number of foci
    /// ([m²/sr] for a spherical wave, [m²/m²] for a plane one).
    pub fn cross_section(&self) -> f64 {
        self.a.determinant()
    }

    /// det B: solid angle of the pencil per unit of dq₁dq₂, signed.
    pub fn solid_angle(&self) -> f64 {
        self.b.determinant()
    }

    /// The curvature tensor K [1/m] in the frame; `None` at a focus.
    pub fn curvature(&self) -> Option<Matrix2> {
        let k = -self.b * self.a.try_inverse()?;
        let k = (k + k.transpose()) * 0.5;
        k.iter().all(|x| x.is_finite()).then_some(k)
    }

    /// Principal curvatures and directions: Euler's view of the same wave; `None` at a focus.
    pub fn principal(&self) -> Option<PrincipalWave> {
        Some(PrincipalWave::from_tensor(self.direction, self.index, self.frame, &self.curvature()?))
    }

    /// Distances [m] along the ray at which the wave focuses, in the present medium, the nearer in
    /// absolute value first: negative behind, infinite for a direction without curvature.
    ///
    /// They are the radii of curvature 1/K, found without a pole at K = ∞.
    pub fn focal_distances(&self) -> [f64; 2] {
        let (a, b) = (&self.a, &self.b);
        let (c, w) = (a.determinant(), b.determinant());
        // The roots of det(A + tB). Foci close to each other lose half their digits in the quadratic's
        // discriminant, but not as eigenvalues of a symmetric tensor: K, or its inverse, whichever is
        // farther from singular. Where both are nearly so, the foci are far apart.
        let health = |m: &Matrix2, det: f64| {
            let square = m.norm_squared();
            if square > 0.0 { det.abs() / square } else { 0.0 }
        };
        let (of_a, of_b) = (health(a, c), health(b, w));
        let [f, g] = if of_a.max(of_b) < 1e-3 {
            let m = a[(0, 0)] * b[(1, 1)] + a[(1, 1)] * b[(0, 0)]
                - a[(0, 1)] * b[(1, 0)]
                - a[(1, 0)] * b[(0, 1)];
            let q = -0.5 * (m + (m * m - 4.0 * c * w).max(0.0).sqrt().copysign(m));
            // A zero over a zero: no curvature at all.
            let over = |x: f64, y: f64| if y != 0.0 { x / y } else { f64::INFINITY };
            [over(c, q), over(q, w)]
        } else if of_b >= of_a {
            symmetric_eigenvalues(&-(a * adjugate(b) / w))
        } else {
            symmetric_eigenvalues(&-(b * adjugate(a) / c)).map(|k| 1.0 / k)
        };
        if f.abs() <= g.abs() { [f, g] } else { [g, f] }
    }

    /// The wave after a distance [m] through its medium, Yu & Wu (1).
    #[must_use]
    pub fn transferred(self, distance: f64) -> Self {
        Self { a: self.a + self.b * distance, ..self }
    }

    /// The wave after a reflection. `None` at grazing incidence, where the pencil covers infinitely
    /// much of the surface.
    #[must_use]
    pub fn reflected(self, at: &LocalGeometry) -> Option<Self> {
        self.reflected_along(at, reflect_direction(&self.direction, &at.n))
    }

    /// The wave after a refraction into a medium of refractive index `index`. `None` at total
    /// reflection and at grazing incidence on either side.
    #[must_use]
    pub fn refracted(self, at: &LocalGeometry, index: f64) -> Option<Self> {
        let after = refract_direction(&self.direction, &at.n, self.index, index)?;
        self.refracted_along(at, after.direction, index)
    }

    /// [`Self::reflected`] where the direction after is known, as along a chain that was traced. The
    /// next leg tells it better than the law does after many vertices.
    #[must_use]
    pub fn reflected_along(self, at: &LocalGeometry, direction: UnitVector3) -> Option<Self> {
        let n = at.n.into_inner();
        let along = self.direction.dot(&n);
        let q = self.shape_across(at, along)?;
        // γ/n = d₂·N − d₁·N and G = 1.
        let b = self.b - q * self.a * (direction.dot(&n) - along);
        let frame = self.frame.map(|e| e - n * (2.0 * e.dot(&n)));
        Some(Self { direction, frame, b, ..self })
    }

    /// [`Self::refracted`] where the direction after is known: close to total reflection the cosine
    /// by Snell's law has lost the digits that the next leg still has.
    #[must_use]
    pub fn refracted_along(
        self,
        at: &LocalGeometry,
        direction: UnitVector3,
        index: f64,
    ) -> Option<Self> {
        let (along, after) = (self.direction.dot(&at.n), direction.dot(&at.n));
        if after == 0.0 {
            return None;
        }
        let q = self.shape_across(at, along)?;
        let gamma = refraction_gamma(along, after, self.index, index);
        // The least turn that takes d₁ to d₂. They are never opposite: refraction turns by less than
        // a right angle.
        let (d1, d2) = (self.direction.into_inner(), direction.into_inner());
        let half = (d1 + d2) / (1.0 + d1.dot(&d2));
        let frame = self.frame.map(|e| e - half * e.dot(&d2));
        // G stretches by cos t/cos i in the plane of incidence, whose direction w in the frame is that
        // of the normal (any at normal incidence). Written so, G and the G of the way back are
        // inverses of each other to rounding.
        let [w1, w2] = self.frame.map(|e| e.dot(&at.n));
        let length = (w1 * w1 + w2 * w2).sqrt();
        let (w1, w2) = if length > 0.0 { (w1 / length, w2 / length) } else { (1.0, 0.0) };
        let stretch = |r: f64| {
            let off = (r - 1.0) * w1 * w2;
            Matrix2::new(r * w1 * w1 + w2 * w2, off, off, r * w2 * w2 + w1 * w1)
        };
        let b = (self.b * self.index - q * self.a * gamma) / index;
        Some(Self {
            direction,
            frame,
            index,
            a: stretch(after / along) * self.a,
            b: stretch(along / after) * b,
        })
    }

    /// Q of the module's head: the surface's shape operator as the transverse plane sees it;
    /// `along` = d·N.
    fn shape_across(&self, at: &LocalGeometry, along: f64) -> Option<Matrix2> {
        if along == 0.0 {
            return None;
        }
        let d = self.direction.into_inner();
        let [u, v] = self.frame.map(|e| e - d * (e.dot(&at.n) / along));
        let (su, sv) = (at.dn_dx * u, at.dn_dx * v);
        let off = -0.5 * (u.dot(&sv) + v.dot(&su));
        let q = Matrix2::new(-u.dot(&su), off, off, -v.dot(&sv));
        q.iter().all(|x| x.is_finite()).then_some(q)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::{Point3, math};

    fn unit(v: Vector3) -> UnitVector3 {
        UnitVector3::new_normalize(v)
    }

    /// A surface z = ½ (κ₁ x² + κ₂ y²) at its apex, normal +z, turned by `angle` about z.
    fn apex(kappa: [f64; 2], angle: f64) -> LocalGeometry {
        let (s, c) = math::sin_cos(angle);
        let (u, v) = (Vector3::new(c, s, 0.0), Vector3::new(-s, c, 0.0));
        let n = unit(Vector3::z());
        let dn_dx = -(u * u.transpose() * kappa[0] + v * v.transpose() * kappa[1]);
        LocalGeometry { x: Point3::origin(), n, ng: n, dn_dx }
    }

    /// Downward, at `incidence` [rad] from the normal, in the xz plane.
    fn downward(incidence: f64) -> UnitVector3 {
        let (s, c) = math::sin_cos(incidence);
        unit(Vector3::new(s, 0.0, -c))
    }

    fn close(got: f64, want: f64, tolerance: f64) {
        assert!((got - want).abs() <= tolerance * want.abs().max(1.0), "{got}, not {want}");
    }

    /// The wave's normal curvatures in the plane of incidence xz and across it.
    fn tangential_sagittal(wave: &Wavefront) -> [f64; 2] {
        let p = wave.principal().unwrap();
        let sagittal = Vector3::y();
        [p.normal_curvature(&sagittal.cross(&wave.direction())), p.normal_curvature(&sagittal)]
    }

    #[test]
    fn transfer_is_the_printed_formula_and_passes_the_focus() {
        let k = Matrix2::new(0.5, 0.1, 0.1, -0.3);
        let wave = Wavefront::with_curvature(unit(Vector3::new(0.1, 0.2, 1.0)), 1.0, &k);
        let before = wave.principal().unwrap().kappa;
        for t in [0.7, 1.9, 2.3, 40.0] {
            let after = wave.transferred(t).principal().unwrap().kappa;
            let mut want = before.map(|k| k / (1.0 - t * k));
            want.sort_by(|a, b| b.total_cmp(a));
            close(after[0], want[0], 1e-13);
            close(after[1], want[1], 1e-13);
            // Yu & Wu (2): r₁r₂/(r'₁r'₂) = dA/dA'.
            let ratio = after[0] * after[1] / (before[0] * before[1]);
            close(1.0 / wave.transferred(t).cross_section(), ratio, 1e-12);
        }
        let [near, far] = wave.focal_distances();
        close(near, 1.0 / before[0], 1e-14);
        close(far, 1.0 / before[1], 1e-14);
        assert!(wave.transferred(near * 0.999).cross_section() > 0.0);
        assert!(wave.transferred(near * 1.001).cross_section() < 0.0);
    }

    #[test]
    fn sources_start_where_they_are() {
        let d = unit(Vector3::new(0.3, -0.4, 1.0));
        let sphere = Wavefront::spherical(d, 1.0);
        assert!(sphere.curvature().is_none());
        assert_eq!(sphere.focal_distances()[0], 0.0);
        let k = sphere.transferred(4.0).curvature().unwrap();
        assert!((k + Matrix2::identity() * 0.25).norm() < 1e-16);
        assert_eq!(sphere.transferred(4.0).cross_section(), 16.0);
        // One focus here, the other at infinity.
        let line = Wavefront::with_curvature(d, 1.0, &Matrix2::new(0.5, 0.0, 0.0, 0.0));
        let [near, far] = line.transferred(2.0).focal_distances();
        assert!(near == 0.0 && far.is_infinite());
        let plane = Wavefront::plane(d, 1.0).transferred(1e6);
        assert_eq!(plane.curvature().unwrap(), Matrix2::zeros());
        assert!(plane.focal_distances().iter().all(|f| f.is_infinite()));
    }

    #[test]
    fn coddington_for_refraction() {
        // n' cos² i'/t' − n cos² i/t = (n' cos i' − n cos i)/R, n'/s' − n/s = the same.
        // R is positive with the centre on the far side, t and s along the light.
        for (n1, n2, r, angle, source) in
            [(1.0, 1.5, 2.0, 0.6, 3.0), (1.5, 1.0, -0.8, 0.5, 1.0), (1.0, 1.33, -1.0, 1.2, 0.3)]
        {
            let wave = Wavefront::spherical(downward(angle), n1)
                .transferred(source)
                .refracted(&apex([-1.0 / r; 2], 0.7), n2)
                .unwrap();
            let cos_i = math::cos(angle);
            let sin_t = math::sin(angle) * n1 / n2;
            let cos_t = (1.0 - sin_t * sin_t).sqrt();
            let power = (n2 * cos_t - n1 * cos_i) / r;
            let tangential = (power - n1 * cos_i * cos_i / source) / (n2 * cos_t * cos_t);
            let sagittal = (power - n1 / source) / n2;
            let [t, s] = tangential_sagittal(&wave);
            close(t, tangential, 1e-13);
            close(s, sagittal, 1e-13);
            // The cross-section changes by cos t/cos i at the surface.
            close(wave.cross_section(), source * source * cos_t / cos_i, 1e-13);
        }
    }

    #[test]
    fn coddington_for_reflection() {
        // 1/s + 1/t' = 2/(R cos i), 1/s + 1/s' = 2 cos i/R.
        for (r, angle, source) in [(2.0, 0.6, 3.0), (-0.8, 1.3, 1.0), (0.5, 0.1, 0.3)] {
            let wave = Wavefront::spherical(downward(angle), 1.3)
                .transferred(source)
                .reflected(&apex([1.0 / r; 2], 0.2))
                .unwrap();
            let cos_i = math::cos(angle);
            let [t, s] = tangential_sagittal(&wave);
            close(t, 2.0 / (r * cos_i) - 1.0 / source, 1e-13);
            close(s, 2.0 * cos_i / r - 1.0 / source, 1e-13);
            close(wave.cross_section(), source * source, 1e-14);
        }
    }

    #[test]
    fn the_normal_s_side_does_not_matter() {
        let at = apex([0.7, -1.1], 0.4);
        let other = LocalGeometry { n: -at.n, ng: -at.ng, dn_dx: -at.dn_dx, ..at };
        let wave = Wavefront::spherical(unit(Vector3::new(0.5, 0.2, -1.0)), 1.2).transferred(2.0);
        let pairs = [
            (wave.reflected(&at).unwrap(), wave.reflected(&other).unwrap()),
            (wave.refracted(&at, 1.6).unwrap(), wave.refracted(&other, 1.6).unwrap()),
        ];
        for (w, o) in pairs {
            assert!((w.direction().dot(&o.direction()) - 1.0).abs() < 1e-15);
            assert!((w.direction_jacobian() - o.direction_jacobian()).norm() < 1e-14);
            assert!((w.position_jacobian() - o.position_jacobian()).norm() < 1e-14);
        }
    }

    #[test]
    fn nothing_passes_at_total_reflection_or_along_the_surface() {
        let wave = Wavefront::plane(downward(1.0), 1.5);
        assert!(wave.refracted(&apex([1.0, 0.0], 0.0), 1.0).is_none());
        let grazing = Wavefront::plane(unit(Vector3::x()), 1.0);
        assert!(grazing.reflected(&apex([1.0, 0.0], 0.0)).is_none());
        assert!(grazing.refracted(&apex([1.0, 0.0], 0.0), 1.5).is_none());
    }

    #[test]
    fn frames_stay_orthonormal_and_tensors_symmetric_over_a_long_chain() {
        // 200 interactions at slanted, astigmatic surfaces of weak curvature.
        let mut wave = Wavefront::spherical(downward(0.3), 1.0).transferred(1.0);
        for i in 0..200 {
            let x = i as f64;
            let tilt = unit(Vector3::new(0.3 * math::sin(1.7 * x), 0.3 * math::cos(2.3 * x), 1.0));
            let n = unit(wave.direction().into_inner() + 0.7 * tilt.into_inner());
            let (u, v) = tangent_frame(&n);
            let dn_dx = u * u.transpose() * 0.01 - v * v.transpose() * 0.015;
            let at = LocalGeometry { x: Point3::origin(), n, ng: n, dn_dx };
            wave = match i % 3 {
                0 => wave.refracted(&at, 1.5),
                1 => wave.reflected(&at),
                _ => wave.refracted(&at, 1.0),
            }
            .unwrap_or(wave)
            .transferred(0.1);
        }
        let [e1, e2] = wave.frame();
        let d = wave.direction().into_inner();
        for (x, y, want) in
            [(e1, e1, 1.0), (e2, e2, 1.0), (e1, e2, 0.0), (e1, d, 0.0), (e2, d, 0.0)]
        {
            assert!((x.dot(&y) - want).abs() < 1e-13);
        }
        let (a, b) = (wave.position_jacobian(), wave.direction_jacobian());
        let s = a.transpose() * b;
        assert!((s[(0, 1)] - s[(1, 0)]).abs() < 1e-12 * a.norm() * b.norm());
    }
}
