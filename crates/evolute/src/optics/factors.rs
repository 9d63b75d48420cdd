//! Intensity and area factors of a chain, and the law between them (Yu & Wu 2.1 to 2.3).
//!
//! A chain P → Y → … → X joins a receiver P to a source X by ideal reflections and refractions; Y is
//! the first vertex seen from P. Two wavefronts run along it in opposite directions:
//!
//! - from P to X: AF(P,Y) = dA_X/dA'_Y (6), (10), both areas across the ray, that of Y on P's side;
//! - from X to P: IF(P,Y) = |YP|² PIF (5), PIF = (dΩ_X/dA_P) Π R_i (3), R_i the reflectance or
//!   transmittance of interaction i.
//!
//! Both are signed: each focus on the way turns the sign, and both waves have equally many.
//!
//! **Where we depart from the print.** Eq. (4) takes (n₂/n₁)²(1−α) for the change of intensity at a
//! refraction. That is the change of *radiance*; the flux density on the wavefront changes by
//! (1−α) cos i/cos t, since flux is kept and the cross-section changes by cos t/cos i. With it, and
//! with the reciprocity of the ray map (Straubel; conservation of étendue), for every chain
//!
//! ```text
//! IF · AF = (n_P/n_X)² Π R_i.
//! ```
//!
//! As printed the product is larger by (n_P/n_X)² Π cos t/cos i (light running from X to P):
//! 1.96 at normal incidence from air into n = 1.4. [`FactorLaw`] offers both.

use super::media::Interaction;
use super::tensor::condition_number;
use super::wavefront::Wavefront;
use crate::geometry::{Matrix2, Point3, Rgb, UnitVector3};
use crate::surface::LocalGeometry;

/// A surface that a chain meets, and what happens there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// The surface at the vertex, in the world frame.
    pub local: LocalGeometry,
    /// Which branch the chain takes.
    pub interaction: Interaction,
    /// Refractive index on the receiver's side of the vertex along the chain.
    pub index_toward_receiver: f64,
    /// Refractive index on the source's side along the chain (the same at a reflection).
    pub index_toward_source: f64,
    /// Reflectance or transmittance R_i = 1 − α as a fraction of the flux, a channel.
    pub throughput: Rgb,
}

/// What happens to the intensity on the wavefront at a refraction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FactorLaw {
    /// (1−α) cos i/cos t: flux is kept.
    #[default]
    EnergyConserving,
    /// (n₂/n₁)²(1−α) as Yu & Wu (4) has it, so that the difference can be seen.
    AsPrinted,
}

/// A chain from a receiver to a point of a source. The rays between consecutive points must obey the
/// laws of reflection and refraction at the vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain<'v> {
    /// P [m].
    pub receiver: Point3,
    /// Y first; at least one.
    pub vertices: &'v [Vertex],
    /// X [m].
    pub source: Point3,
}

/// A chain from a receiver to collimated light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollimatedChain<'v> {
    /// P [m].
    pub receiver: Point3,
    /// Y first; at least one.
    pub vertices: &'v [Vertex],
    /// The direction in which the light travels before it meets the last vertex.
    pub light: UnitVector3,
}

/// The factors of a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors {
    /// (dΩ_X/dA_P) |YP|², signed: the intensity factor without Π R_i. Infinite where P is at a focus
    /// of the wave from X.
    pub concentration: f64,
    /// AF (6), (10): dA_X/dA'_Y, signed.
    pub area: f64,
    /// Π R_i.
    pub throughput: Rgb,
    /// What the law of intensity adds beyond flux: 1, or (n_P/n_X)² Π cos t/cos i as printed.
    pub rectification: f64,
    /// n_P/n_X.
    pub index_ratio: f64,
    /// |YP| [m].
    pub first_leg: f64,
    /// ∂(position at X)/∂(angle at P) [m/rad], across the rays.
    pub jacobian: Matrix2,
}

/// The factors of a chain into collimated light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollimatedFactors {
    /// dA₀/dA_P, signed: cross-section of a pencil before the first surface the light meets over that
    /// at P. Infinite where P is at a focus.
    pub concentration: f64,
    /// Π R_i.
    pub throughput: Rgb,
    /// As in [`Factors::rectification`].
    pub rectification: f64,
    /// dΩ₀/dΩ_P, signed: how far directions toward the light spread when directions at P do. Its
    /// product with `concentration` is (n_P/n₀)².
    pub spread: f64,
    /// n_P/n₀.
    pub index_ratio: f64,
}

impl Factors {
    /// IF(P,Y) (5), signed.
    pub fn intensity(&self) -> Rgb {
        self.throughput * (self.concentration * self.rectification)
    }

    /// PIF (3), signed [1/m²].
    pub fn path_intensity(&self) -> Rgb {
        self.intensity() * (1.0 / (self.first_leg * self.first_leg))
    }

    /// IF · AF as the two wavefronts have it: not a number at a focus.
    pub fn product(&self) -> Rgb {
        self.intensity() * self.area
    }

    /// IF · AF in closed form: (n_P/n_X)² Π R_i, times the rectification of the law chosen. Finite and
    /// positive at foci too.
    pub fn invariant(&self) -> Rgb {
        self.throughput * (self.index_ratio * self.index_ratio * self.rectification)
    }

    /// Virtual radiance at Y toward P [W/(m² sr)] for the radiance at X toward Y (7), by the
    /// closed form.
    pub fn virtual_radiance(&self, radiance: Rgb) -> Rgb {
        self.invariant() * radiance
    }

    /// Condition number σ₁/σ₂ of the ray map from P to X.
    pub fn condition(&self) -> f64 {
        condition_number(&self.jacobian)
    }
}

impl CollimatedFactors {
    /// Irradiance at P [W/m²] for the irradiance `normal` [W/m²] on a plane across the collimated
    /// light, at the angle θ₁ between the last leg and the receiver's normal:
    /// E = E₀ |dA₀/dA_P| Π R_i cos θ₁.
    pub fn irradiance(&self, normal: Rgb, cos_theta: f64) -> Rgb {
        normal
            * self.throughput
            * (self.concentration.abs() * self.rectification * cos_theta.max(0.0))
    }
}

impl Chain<'_> {
    /// Both factors by two wavefronts in opposite directions. `None` if a leg has no length, a vertex
    /// is met at grazing incidence, or a refraction is impossible.
    pub fn factors(&self, law: FactorLaw) -> Option<Factors> {
        let (first, last) = (self.vertices.first()?, self.vertices.last()?);
        let n_receiver = first.index_toward_receiver;
        let n_source = last.index_toward_source;

        // AF (10): from P to X.
        let (direction, first_leg) = leg(&self.receiver, &first.local.x)?;
        let wave = Wavefront::spherical(direction, n_receiver).transferred(first_leg);
        let (last_direction, last_leg) = leg(&last.local.x, &self.source)?;
        let wave = from_receiver(wave, self.vertices, last_direction)?;
        let jacobian = wave.transferred(last_leg).position_jacobian();
        let square = first_leg * first_leg;
        let area = jacobian.determinant() / square;

        // IF (3), (5): from X to P.
        let wave = Wavefront::spherical(-last_direction, n_source).transferred(last_leg);
        let wave = from_source(wave, self.vertices, -direction)?;
        let concentration = square / wave.transferred(first_leg).cross_section();

        Some(Factors {
            concentration,
            area,
            throughput: throughput(self.vertices),
            rectification: rectification(law, self.vertices, &self.receiver, &self.source),
            index_ratio: n_receiver / n_source,
            first_leg,
            jacobian,
        })
    }
}

impl CollimatedChain<'_> {
    /// The factors by two wavefronts in opposite directions; `None` as for [`Chain::factors`].
    pub fn factors(&self, law: FactorLaw) -> Option<CollimatedFactors> {
        let (first, last) = (self.vertices.first()?, self.vertices.last()?);
        let (n_receiver, n_source) = (first.index_toward_receiver, last.index_toward_source);
        let (direction, first_leg) = leg(&self.receiver, &first.local.x)?;

        let wave = Wavefront::spherical(direction, n_receiver).transferred(first_leg);
        let spread = from_receiver(wave, self.vertices, -self.light)?.solid_angle();

        let wave = Wavefront::plane(self.light, n_source);
        let wave = from_source(wave, self.vertices, -direction)?;
        let concentration = 1.0 / wave.transferred(first_leg).cross_section();

        // Any point on the last leg will do where only directions count.
        let behind = last.local.x - self.light.into_inner();
        Some(CollimatedFactors {
            concentration,
            throughput: throughput(self.vertices),
            rectification: rectification(law, self.vertices, &self.receiver, &behind),
            spread,
            index_ratio: n_receiver / n_source,
        })
    }
}

/// Direction and length [m] of a leg; `None` if it has none.
fn leg(from: &Point3, to: &Point3) -> Option<(UnitVector3, f64)> {
    UnitVector3::try_new_and_get(to - from, 0.0)
}

/// The wave that comes from P and is at Y, behind the last vertex, where it leaves along `last`.
fn from_receiver(mut wave: Wavefront, chain: &[Vertex], last: UnitVector3) -> Option<Wavefront> {
    for (i, vertex) in chain.iter().enumerate() {
        let next = match chain.get(i + 1) {
            Some(v) => leg(&vertex.local.x, &v.local.x)?,
            None => (last, 0.0),
        };
        wave = passed(wave, vertex, next.0, vertex.index_toward_source)?.transferred(next.1);
    }
    Some(wave)
}

/// The wave that comes from X and is at the last vertex, behind Y, where it leaves along `last`.
fn from_source(mut wave: Wavefront, chain: &[Vertex], last: UnitVector3) -> Option<Wavefront> {
    for (i, vertex) in chain.iter().enumerate().rev() {
        let next = match i.checked_sub(1).and_then(|before| chain.get(before)) {
            Some(v) => leg(&vertex.local.x, &v.local.x)?,
            None => (last, 0.0),
        };
        wave = passed(wave, vertex, next.0, vertex.index_toward_receiver)?.transferred(next.1);
    }
    Some(wave)
}

fn passed(wave: Wavefront, vertex: &Vertex, to: UnitVector3, index: f64) -> Option<Wavefront> {
    match vertex.interaction {
        Interaction::Reflection => wave.reflected_along(&vertex.local, to),
        Interaction::Refraction => wave.refracted_along(&vertex.local, to, index),
    }
}

fn throughput(vertices: &[Vertex]) -> Rgb {
    vertices.iter().fold(Rgb::WHITE, |product, v| product * v.throughput)
}

/// Π over refractions of (n_P/n_X)² cos t/cos i, the indices on the two sides of each and the light
/// running toward P, if the law is as printed.
fn rectification(law: FactorLaw, vertices: &[Vertex], receiver: &Point3, source: &Point3) -> f64 {
    if law == FactorLaw::EnergyConserving {
        return 1.0;
    }
    let mut factor = 1.0;
    for (i, vertex) in vertices.iter().enumerate() {
        if vertex.interaction == Interaction::Reflection {
            continue;
        }
        let before = if i == 0 { *receiver } else { vertices[i - 1].local.x };
        let after = vertices.get(i + 1).map_or(*source, |v| v.local.x);
        let cos = |to: Point3| {
            let v = to - vertex.local.x;
            (v.dot(&vertex.local.n) / v.norm()).abs()
        };
        let ratio = vertex.index_toward_receiver / vertex.index_toward_source;
        factor *= ratio * ratio * cos(before) / cos(after);
    }
    factor
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::{Matrix3, Vector3};

    /// A plane through `x` with normal +z.
    fn plane(x: Point3, interaction: Interaction, n: [f64; 2], throughput: f64) -> Vertex {
        let z = UnitVector3::new_normalize(Vector3::z());
        let local = LocalGeometry { x, n: z, ng: z, dn_dx: Matrix3::zeros() };
        Vertex {
            local,
            interaction,
            index_toward_receiver: n[0],
            index_toward_source: n[1],
            throughput: Rgb::grey(throughput),
        }
    }

    #[test]
    fn planar_mirror_is_the_virtual_image() {
        // P 1 m and X 2 m above the mirror: the image of X is 3/cos away.
        let receiver = Point3::new(-0.5, 0.0, 1.0);
        let source = Point3::new(1.0, 0.0, 2.0);
        let v = [plane(Point3::origin(), Interaction::Reflection, [1.0, 1.0], 0.8)];
        let f = Chain { receiver, vertices: &v, source }.factors(FactorLaw::AsPrinted).unwrap();
        let (near, far) = (receiver.coords.norm(), source.coords.norm());
        let image = near + far;
        assert!((f.area - (image / near) * (image / near)).abs() < 1e-14);
        assert!((f.intensity()[0] - 0.8 * (near / image) * (near / image)).abs() < 1e-15);
        assert!((f.product()[1] - 0.8).abs() < 1e-15 && f.rectification == 1.0);
        assert!((f.condition() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn the_printed_law_overshoots_by_196_at_normal_incidence_into_1_4() {
        let v = [plane(Point3::origin(), Interaction::Refraction, [1.4, 1.0], 1.0)];
        let chain = Chain {
            receiver: Point3::new(0.0, 0.0, -2.0),
            vertices: &v,
            source: Point3::new(0.0, 0.0, 3.0),
        };
        let ours = chain.factors(FactorLaw::EnergyConserving).unwrap();
        let printed = chain.factors(FactorLaw::AsPrinted).unwrap();
        assert!((ours.product()[0] - 1.96).abs() < 1e-14);
        assert!((printed.product()[0] / ours.product()[0] - 1.96).abs() < 1e-14);
        assert!((printed.invariant()[0] - printed.product()[0]).abs() < 1e-14);
    }

    #[test]
    fn a_chain_without_vertices_or_with_an_empty_leg_has_no_factors() {
        let p = Point3::origin();
        let none = Chain { receiver: p, vertices: &[], source: p };
        assert!(none.factors(FactorLaw::default()).is_none());
        let v = [plane(p, Interaction::Reflection, [1.0, 1.0], 1.0)];
        let empty = Chain { receiver: p, vertices: &v, source: Point3::new(0.0, 0.0, 1.0) };
        assert!(empty.factors(FactorLaw::default()).is_none());
    }
}
