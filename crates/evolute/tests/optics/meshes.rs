//! Meshes with vertex normals: the symmetrised curvature against traced rays, to first order in the
//! size of the facets.

use crate::bodies::Random;
use evolute::geometry::{Matrix2, Point3, Rgb, UnitVector3, Vector3, math, tangent_frame};
use evolute::optics::{
    Chain, FactorLaw, Interaction, Vertex, Wavefront, reflect_direction, refract_direction,
};
use evolute::surface::{LocalGeometry, Mesh, MeshSmoothing, SurfacePoint};
use std::f64::consts::{PI, TAU};

/// An ellipsoid of `segments` around and half as many from pole to pole, with the ellipsoid's own
/// normals at the vertices.
fn ellipsoid(axes: Vector3, segments: u32) -> Mesh {
    let rings = segments / 2;
    let (mut positions, mut normals, mut triangles) = (vec![], vec![], vec![]);
    for j in 0..=rings {
        for i in 0..segments {
            let (sp, cp) = math::sin_cos(TAU * f64::from(i) / f64::from(segments));
            let (st, ct) = math::sin_cos(PI * f64::from(j) / f64::from(rings));
            let d = Vector3::new(st * cp, st * sp, ct);
            positions.push(Point3::from(d.component_mul(&axes)));
            normals.push(d.component_div(&axes).normalize());
        }
    }
    for j in 0..rings {
        for i in 0..segments {
            let at = |i: u32, j: u32| j * segments + i % segments;
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
            // The other triangle of a pole's quadrilateral has no area.
            if j + 1 < rings {
                triangles.push([a, b, c]);
            }
            if j > 0 {
                triangles.push([a, c, d]);
            }
        }
    }
    let mesh = Mesh::new(positions, triangles, Some(normals), None).unwrap();
    // Rays meet the planes of the facets below.
    mesh.with_smoothing(MeshSmoothing::Facets)
}

/// Where a ray meets the plane of a facet, with the normal that its vertices give there.
fn meet(mesh: &Mesh, triangle: u32, o: &Point3, d: &UnitVector3) -> LocalGeometry {
    let [a, b, c] = mesh.corners(triangle);
    let across = mesh.area_vector(triangle);
    let x = o + d.into_inner() * (across.dot(&(a - o)) / across.dot(d));
    let square = across.norm_squared();
    let p = across.dot(&(x - a).cross(&(c - a))) / square;
    let q = across.dot(&(b - a).cross(&(x - a))) / square;
    mesh.local(&SurfacePoint { primitive: triangle, p, q, x }).unwrap()
}

/// One reflection or refraction at a random facet, from and to points about 1 m away: how far the
/// wave's Jacobian is from traced rays, as fractions of ‖J‖ and of ‖J‖²; and IF·AF from the law.
fn gaps(mesh: &Mesh, r: &mut Random) -> Option<[f64; 3]> {
    let triangle = r.below(mesh.triangles().len()) as u32;
    let (mut p, mut q) = (r.uniform(0.0, 1.0), r.uniform(0.0, 1.0));
    if p + q > 1.0 {
        (p, q) = (1.0 - p, 1.0 - q);
    }
    let at = mesh.local(&mesh.at(triangle, p, q)).unwrap();
    let d = r.direction();
    let cos = d.dot(&at.n).abs();
    // Where geometric and shading normal disagree about the side there is nothing to compare.
    if cos < 0.2 || d.dot(&at.n) * d.dot(&at.ng) <= 0.0 {
        return None;
    }
    let (n1, n2) = if d.dot(&at.n) < 0.0 { (1.0, 1.5) } else { (1.5, 1.0) };
    let reflects = r.chance(0.5);
    let bend = |d: &UnitVector3, n: &UnitVector3| {
        if reflects {
            Some(reflect_direction(d, n))
        } else {
            refract_direction(d, n, n1, n2).map(|f| f.direction)
        }
    };
    let out = bend(&d, &at.n)?;
    if out.dot(&at.n).abs() < 0.2 || out.dot(&at.ng) * out.dot(&at.n) <= 0.0 {
        return None;
    }
    let (start, end) = (
        at.x - d.into_inner() * r.uniform(0.5, 2.0),
        at.x + out.into_inner() * r.uniform(0.5, 2.0),
    );
    let wave = Wavefront::spherical(d, n1).transferred((at.x - start).norm());
    let wave = if reflects { wave.reflected(&at)? } else { wave.refracted(&at, n2)? };
    let wave = wave.transferred((end - at.x).norm());

    let ends = |e: &Vector3, h: f64| {
        let d = UnitVector3::new_normalize(d.into_inner() + e * h);
        let local = meet(mesh, triangle, &start, &d);
        let leaves = bend(&d, &local.n)?;
        let t = out.dot(&(end - local.x)) / out.dot(&leaves);
        Some(local.x + leaves.into_inner() * t)
    };
    let (e1, e2) = tangent_frame(&d);
    let h = 1e-6;
    let c1 = (ends(&e1, h)? - ends(&e1, -h)?) / (2.0 * h);
    let c2 = (ends(&e2, h)? - ends(&e2, -h)?) / (2.0 * h);
    let [f1, f2] = wave.frame();
    let traced = Matrix2::new(f1.dot(&c1), f1.dot(&c2), f2.dot(&c1), f2.dot(&c2));
    let ours = wave.position_jacobian();

    let vertex = Vertex {
        local: at,
        interaction: if reflects { Interaction::Reflection } else { Interaction::Refraction },
        index_toward_receiver: n1,
        index_toward_source: if reflects { n1 } else { n2 },
        throughput: Rgb::WHITE,
    };
    let factors =
        Chain { receiver: start, vertices: &[vertex], source: end }.factors(FactorLaw::default())?;
    let bound = (1e-13 * factors.condition()).max(1e-9);
    Some([
        (ours - traced).norm() / traced.norm(),
        (ours.determinant() - traced.determinant()).abs() / traced.norm_squared(),
        (factors.product()[0] / factors.invariant()[0] - 1.0).abs() / bound,
    ])
}

#[test]
fn meshes_come_closer_as_they_are_refined() {
    println!(
        "\nmeshes with vertex normals: median gap from traced rays (matrix/‖J‖, determinant/‖J‖²)"
    );
    for (name, axes) in
        [("sphere", Vector3::new(1.0, 1.0, 1.0)), ("ellipsoid", Vector3::new(1.0, 0.8, 0.6))]
    {
        let mut before: Option<[f64; 2]> = None;
        for segments in [16, 32, 64, 128] {
            let mesh = ellipsoid(axes, segments);
            let mut r = Random(7);
            let mut found = vec![];
            while found.len() < 4000 {
                found.extend(gaps(&mesh, &mut r));
            }
            let median = |i: usize| {
                let mut v: Vec<f64> = found.iter().map(|g| g[i]).collect();
                v.sort_by(f64::total_cmp);
                v[v.len() / 2]
            };
            let now = [median(0), median(1)];
            println!("  {name:9} {segments:4} segments: {:.5} {:.5}", now[0], now[1]);
            // The law holds by construction, whatever the facets.
            assert!(found.iter().all(|g| g[2] <= 1.0));
            // Half the size, about half the gap.
            if let Some(before) = before {
                for i in 0..2 {
                    let ratio = now[i] / before[i];
                    assert!((0.4..0.6).contains(&ratio), "{name} {segments}: {ratio}");
                }
            }
            if segments == 64 {
                assert!(now[1] < 0.01, "{name}: {now:?}");
            }
            before = Some(now);
        }
    }
}
