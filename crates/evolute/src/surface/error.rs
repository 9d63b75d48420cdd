//! What can be wrong with the data of a surface.

/// Why no surface can be made of the given data.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// A length that must be positive is not, or is not finite.
    #[error("{what} must be finite and greater than zero, but it is {value}")]
    NotPositive {
        /// What the number is, with its article ("the radius").
        what: &'static str,
        /// The number as given.
        value: f64,
    },
    /// A coordinate is infinite or not a number.
    #[error("{what} has a coordinate that is not a finite number")]
    NotFinite {
        /// What the point is ("the centre", "vertex 17").
        what: String,
    },
    /// The transform does not keep the shape's kind.
    #[error(
        "a {shape} stays a {shape} only when it is moved, turned, mirrored or scaled {how}; this \
         transform stretches or shears it; formulas (parametric) can say what it makes"
    )]
    Distorted {
        /// The shape.
        shape: &'static str,
        /// Which scaling is allowed.
        how: &'static str,
    },
    /// The shape has no area in double precision.
    #[error(
        "the {shape} is squeezed to nothing: it has no area; formulas and transforms must leave it \
         length and width"
    )]
    NoArea {
        /// The shape.
        shape: &'static str,
    },
    /// A mesh has no triangles.
    #[error("the mesh has no triangles")]
    NoTriangles,
    /// A triangle refers to a vertex that is not there.
    #[error("triangle {triangle} refers to vertex {vertex}, but the mesh has {count} vertices, 0 to {}", .count.saturating_sub(1))]
    NoSuchVertex {
        /// The triangle, counted from 0.
        triangle: usize,
        /// The index it gives.
        vertex: u32,
        /// How many vertices there are.
        count: usize,
    },
    /// Per-vertex data that does not fit the vertices.
    #[error("the mesh has {vertices} vertices but {given} {what}")]
    WrongCount {
        /// What is counted ("normals", "texture coordinates").
        what: &'static str,
        /// How many vertices there are.
        vertices: usize,
        /// How many were given.
        given: usize,
    },
    /// The formulas of a parametric surface cannot be compiled.
    #[error("{message}")]
    Formula {
        /// A sentence.
        message: String,
    },
    /// A formula is not defined, or infinite, somewhere in the domain.
    #[error(
        "the parametric surface is not defined at s = {s}, t = {t}: its position there is ({}, {}, \
         {}); it must be finite for all s and t from 0 to 1", .x[0], .x[1], .x[2]
    )]
    Undefined {
        /// First parameter.
        s: f64,
        /// Second parameter.
        t: f64,
        /// What the formulas give there, world frame [m].
        x: [f64; 3],
    },
    /// A formula runs off to infinity somewhere in the domain.
    #[error(
        "the parametric surface cannot be bounded near s = {s}, t = {t}; its formulas must be finite \
         for all s and t from 0 to 1 (is something divided by zero there?)"
    )]
    Unbounded {
        /// First parameter.
        s: f64,
        /// Second parameter.
        t: f64,
    },
    /// More vertices or triangles than 32-bit indices can name.
    #[error("the mesh has {0} {1}; more than 4,294,967,295 cannot be indexed")]
    TooMany(usize, &'static str),
}

/// `Ok` if `value` is finite and positive.
pub(super) fn positive(what: &'static str, value: f64) -> Result<f64, SurfaceError> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(SurfaceError::NotPositive { what, value })
    }
}

/// `Ok` if all coordinates are finite.
pub(super) fn finite(
    what: &str,
    point: crate::geometry::Point3,
) -> Result<crate::geometry::Point3, SurfaceError> {
    if point.iter().all(|x| x.is_finite()) {
        Ok(point)
    } else {
        Err(SurfaceError::NotFinite { what: what.to_owned() })
    }
}
