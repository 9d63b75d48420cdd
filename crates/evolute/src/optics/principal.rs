//! Wavefronts as the classical texts have them: two principal curvatures and their directions,
//! carried over surfaces by Euler's formulas.
//!
//! Source: Stavroudis, The Optics of Rays, Wavefronts, and Caustics (1972), ch. 10, in the form that
//! Mitchell & Hanrahan (1992) and with them Yu & Wu use. With u the normal of the plane of incidence
//! and v across it, both waves and the surface have normal curvatures κ_u, κ_v and a torsion κ_uv by
//! Euler's formula, and
//!
//! ```text
//! n₂ κ'_u = n₁ κ_u + γ S_u
//! n₂ κ'_uv cos t = n₁ κ_uv cos i + γ S_uv
//! n₂ κ'_v cos² t = n₁ κ_v cos² i + γ S_v
//! ```
//!
//! after which Euler's formula is inverted. Here κ is positive when converging, S with respect to the
//! normal N, and γ that of n₂d₂ − n₁d₁ = γN; at a reflection the cosine after is −cos i along N, which
//! turns the sign of the torsion. This is a second implementation beside the tensor of `wavefront`,
//! written so that each can be held against the other; it is undefined at foci (κ = ∞).

use super::media::{reflect_direction, refract_direction};
use crate::geometry::{Matrix2, UnitVector3, Vector3, tangent_frame};
use crate::surface::{LocalGeometry, PrincipalCurvatures};

/// A wave at a point of a ray by its principal curvatures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipalWave {
    /// Direction of the ray, along the light.
    pub direction: UnitVector3,
    /// Refractive index of the medium.
    pub index: f64,
    /// Principal curvatures, the larger first, positive when converging [1/m].
    pub kappa: [f64; 2],
    /// Their directions: orthonormal, across the ray; any pair at an umbilic.
    pub axes: [Vector3; 2],
}

impl PrincipalWave {
    /// Eigenvalues and eigenvectors of the symmetric tensor `k` [1/m] in the orthonormal `frame`.
    pub fn from_tensor(
        direction: UnitVector3,
        index: f64,
        frame: [Vector3; 2],
        k: &Matrix2,
    ) -> Self {
        let (mean, half, off) =
            (0.5 * (k[(0, 0)] + k[(1, 1)]), 0.5 * (k[(0, 0)] - k[(1, 1)]), k[(0, 1)]);
        let radius = (half * half + off * off).sqrt();
        // Half the angle of (half, off), from the larger of the two possible sums; no trigonometry.
        let (c, s) = if radius == 0.0 {
            (1.0, 0.0)
        } else if half >= 0.0 {
            let (c, s) = (radius + half, off);
            let length = (c * c + s * s).sqrt();
            (c / length, s / length)
        } else {
            let (c, s) = (off, radius - half);
            let length = (c * c + s * s).sqrt();
            (c / length, s / length)
        };
        let axes = [frame[0] * c + frame[1] * s, frame[1] * c - frame[0] * s];
        Self { direction, index, kappa: [mean + radius, mean - radius], axes }
    }

    /// The tensor [1/m] in an orthonormal frame across the ray.
    pub fn tensor(&self, frame: [Vector3; 2]) -> Matrix2 {
        let torsion = self.torsion(&frame[0], &frame[1]);
        Matrix2::new(
            self.normal_curvature(&frame[0]),
            torsion,
            torsion,
            self.normal_curvature(&frame[1]),
        )
    }

    /// Euler's formula: κ₁ cos²φ + κ₂ sin²φ for a unit vector across the ray [1/m].
    pub fn normal_curvature(&self, u: &Vector3) -> f64 {
        euler(&self.kappa, &self.axes, u, u)
    }

    /// Euler's formula for the torsion: (κ₁ − κ₂) sin φ cos φ up to the sense of v ⟂ u [1/m].
    pub fn torsion(&self, u: &Vector3, v: &Vector3) -> f64 {
        euler(&self.kappa, &self.axes, u, v)
    }

    /// The wave after a distance [m], Yu & Wu (1) as printed. Infinite at a focus.
    #[must_use]
    pub fn transferred(self, distance: f64) -> Self {
        let kappa = self.kappa.map(|k| k / (1.0 - distance * k));
        let [k1, k2] = kappa;
        let [e1, e2] = self.axes;
        if k1 >= k2 {
            Self { kappa, ..self }
        } else {
            Self { kappa: [k2, k1], axes: [e2, -e1], ..self }
        }
    }

    /// The wave after a reflection; `None` at grazing incidence.
    #[must_use]
    pub fn reflected(self, at: &LocalGeometry) -> Option<Self> {
        let after = reflect_direction(&self.direction, &at.n);
        let along = self.direction.dot(&at.n);
        self.across_surface(at, after, self.index, [along, -along])
    }

    /// The wave after a refraction into a medium of refractive index `index`; `None` at total
    /// reflection and at grazing incidence.
    #[must_use]
    pub fn refracted(self, at: &LocalGeometry, index: f64) -> Option<Self> {
        let after = refract_direction(&self.direction, &at.n, self.index, index)?;
        let along = self.direction.dot(&at.n);
        let along_after = after.cos_t.copysign(along);
        self.across_surface(at, after.direction, index, [along, along_after])
    }

    /// The three relations at the head of this module; `c` holds d₁·N and d₂·N.
    fn across_surface(
        self,
        at: &LocalGeometry,
        after: UnitVector3,
        index: f64,
        c: [f64; 2],
    ) -> Option<Self> {
        if c[0] == 0.0 || c[1] == 0.0 {
            return None;
        }
        let normal = at.n.into_inner();
        // u: normal of the plane of incidence; any tangent at normal incidence.
        let u = normal.cross(&self.direction);
        let u = match UnitVector3::try_new(u, f64::MIN_POSITIVE) {
            Some(u) => u.into_inner(),
            None => tangent_frame(&at.n).0,
        };
        let v_surface = u.cross(&normal);
        let v_before = u.cross(&self.direction);
        let v_after = u.cross(&after);
        let PrincipalCurvatures { kappa, directions } = at.principal_curvatures();
        let surface = |a: &Vector3, b: &Vector3| euler(&kappa, &directions, a, b);
        let (n1, n2) = (self.index, index);
        let gamma = n2 * c[1] - n1 * c[0];
        let uu = n1 * self.normal_curvature(&u) + gamma * surface(&u, &u);
        let uv = n1 * self.torsion(&u, &v_before) * c[0] + gamma * surface(&u, &v_surface);
        let vv = n1 * self.normal_curvature(&v_before) * c[0] * c[0]
            + gamma * surface(&v_surface, &v_surface);
        let off = uv / (n2 * c[1]);
        let k = Matrix2::new(uu / n2, off, off, vv / (n2 * c[1] * c[1]));
        Some(Self::from_tensor(after, index, [u, v_after], &k))
    }
}

/// Σ κ_i (e_i·u)(e_i·v).
fn euler(kappa: &[f64; 2], axes: &[Vector3; 2], u: &Vector3, v: &Vector3) -> f64 {
    kappa[0] * axes[0].dot(u) * axes[0].dot(v) + kappa[1] * axes[1].dot(u) * axes[1].dot(v)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::{Point3, math};
    use crate::optics::Wavefront;
    use proptest::prelude::*;

    fn unit(x: f64, y: f64, z: f64) -> UnitVector3 {
        UnitVector3::new_normalize(Vector3::new(x, y, z))
    }

    #[test]
    fn eigenvectors_of_a_tensor_give_it_back() {
        let d = unit(0.3, -0.2, 1.0);
        let (s, t) = tangent_frame(&d);
        for k in [
            Matrix2::new(2.0, 0.3, 0.3, -1.0),
            Matrix2::new(-1.0, 0.3, 0.3, 2.0),
            Matrix2::new(-1.0, -1e-9, -1e-9, -1.0),
            Matrix2::new(0.0, -3.0, -3.0, 0.0),
            Matrix2::identity() * 4.0,
        ] {
            let wave = PrincipalWave::from_tensor(d, 1.0, [s, t], &k);
            assert!((wave.tensor([s, t]) - k).norm() < 1e-15 * k.norm());
            assert!(wave.kappa[0] >= wave.kappa[1]);
            assert!(wave.torsion(&wave.axes[0], &wave.axes[1]).abs() < 1e-15);
        }
    }

    #[test]
    fn euler_s_formula_as_printed() {
        let d = unit(0.0, 0.0, 1.0);
        let wave = PrincipalWave {
            direction: d,
            index: 1.0,
            kappa: [2.0, -0.5],
            axes: [Vector3::x(), Vector3::y()],
        };
        let (sin, cos) = math::sin_cos(0.7);
        let u = Vector3::new(cos, sin, 0.0);
        let v = Vector3::new(sin, -cos, 0.0);
        assert!((wave.normal_curvature(&u) - (2.0 * cos * cos - 0.5 * sin * sin)).abs() < 1e-15);
        assert!((wave.torsion(&u, &v) - 2.5 * sin * cos).abs() < 1e-15);
    }

    type Step = ([f64; 2], [f64; 2], f64, Option<f64>, f64);

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        let step = (
            prop::array::uniform2(-0.9..0.9f64), // slant of the surface
            prop::array::uniform2(-2.0..2.0f64), // its principal curvatures [1/m]
            0.0..3.2f64,                         // their direction
            prop::option::of(1.0..2.0f64),       // refractive index behind, or a mirror
            0.1..2.0f64,                         // way to go
        );
        prop::collection::vec(step, 1..=6)
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            failure_persistence: None, // no files beside the sources
            ..ProptestConfig::with_cases(2000)
        })]
        #[test]
        fn euler_and_the_tensor_agree(steps in steps(), k in prop::array::uniform3(-1.0..1.0f64)) {
            let d = unit(0.2, -0.4, 1.0);
            let (s, t) = tangent_frame(&d);
            let tensor = Matrix2::new(k[0], k[1], k[1], k[2]);
            let mut wave = Wavefront::with_curvature(d, 1.0, &tensor);
            let mut euler = PrincipalWave::from_tensor(d, 1.0, [s, t], &tensor);
            for (slant, kappa, angle, behind, way) in steps {
                let d = wave.direction();
                let (s, t) = tangent_frame(&d);
                let n = UnitVector3::new_normalize(-d.into_inner() + s * slant[0] + t * slant[1]);
                let (u, v) = tangent_frame(&n);
                let (sin, cos) = math::sin_cos(angle);
                let (u, v) = (u * cos + v * sin, v * cos - u * sin);
                let dn_dx = -(u * u.transpose() * kappa[0] + v * v.transpose() * kappa[1]);
                let at = LocalGeometry { x: Point3::origin(), n, ng: n, dn_dx };
                let next = match behind {
                    Some(index) => wave.refracted(&at, index).zip(euler.refracted(&at, index)),
                    None => wave.reflected(&at).zip(euler.reflected(&at)),
                };
                let Some((w, e)) = next else { break }; // total reflection
                (wave, euler) = (w.transferred(way), e.transferred(way));
                // Close to a focus κ loses digits like κ² in either form.
                let Some(k) = wave.curvature() else { break };
                let scale = k.norm().max(1.0);
                prop_assume!(scale < 1e3);
                prop_assert!((euler.tensor(wave.frame()) - k).norm() < 1e-9 * scale);
                prop_assert!((euler.direction.into_inner() - wave.direction().into_inner()).norm() < 1e-13);
            }
        }
    }
}
