//! Where light of lamps lands, by rays from the lamps.
//!
//! Light at the corners of a triangle says nothing of what lies between: a caustic can be narrower, and so can the spot
//! that a lamp throws through a hole. Rays that share a lamp's flux evenly, and after specular chains those from a few
//! points of each lamp, aimed evenly at specular surfaces, are too coarse to measure light with, but they tell
//! which triangles receive what their corners do not know of (Yu & Wu, 3.3, criterion 5, for meshes).

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::{Job, Sheet};
use crate::geometry::{Point3, Ray, math, tangent_frame};
use crate::receiver::TriangleMesh;
use crate::scene::{Scene, ShapeId};
use crate::surface::ChartPoint;
use crate::trace::tree::{Trunk, sight};
use crate::trace::{Anchor, Tracer};

/// Rays, about, of either kind.
const RAYS: usize = 40_000;
/// Pieces of a lamp from which rays start that share its flux.
const PIECES: usize = 1000;
/// From most points of a lamp.
const POINTS: usize = 16;
/// Fewest and most rays from a point to a surface.
const LEAST: usize = 16;
const MOST: usize = 2000;

/// Light that landed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Landing {
    pub sheet: usize,
    pub site: ChartPoint,
    /// Its luminance [W].
    pub flux: f64,
}

/// A piece of a surface.
struct Piece {
    shape: ShapeId,
    site: ChartPoint,
    /// [m²]
    area: f64,
}

/// The pieces of a surface, some thousandths of it each.
fn pieces(scene: &Scene, shape: ShapeId, count: usize) -> Vec<Piece> {
    let surface = &scene.shape(shape).surface;
    // Triangles of such edges have about half their square.
    let edge = (2.0 * surface.area() / count as f64).sqrt();
    let mesh = TriangleMesh::new(surface, edge);
    let third = [1.0 / 3.0; 3];
    let piece =
        |t| Piece { shape, site: mesh.at(t, third), area: mesh.weights(t).iter().sum::<f64>() };
    mesh.triangles().map(piece).collect()
}

/// Of many pieces a few that stand for all.
fn some(pieces: Vec<Piece>, most: usize) -> Vec<Piece> {
    let stride = pieces.len().div_ceil(most).max(1);
    let whole: f64 = pieces.iter().map(|p| p.area).sum();
    let mut some: Vec<Piece> = pieces.into_iter().step_by(stride).collect();
    let kept: f64 = some.iter().map(|p| p.area).sum();
    some.iter_mut().for_each(|p| p.area *= whole / kept);
    some
}

/// A lattice of low discrepancy in the unit cube (additive recurrence by powers of the root of x⁴ = x + 1).
fn lattice(i: usize) -> [f64; 3] {
    [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_3]
        .map(|step| (0.5 + step * i as f64).fract())
}

/// What lands on sheets of the light of all lamps, straight.
pub(super) fn straight_landings(job: &Job<'_, '_>) -> Vec<Landing> {
    let (scene, tracer) = (job.scene, job.tracer);
    let all = scene.emitted_flux().luminance();
    let of_lamp = |lamp: ShapeId| {
        let flux = scene.shape(lamp).emitted_flux().luminance();
        let count = (RAYS as f64 * flux / all).ceil() as usize;
        let pieces = pieces(scene, lamp, PIECES);
        let ends: Vec<f64> = pieces
            .iter()
            .scan(0.0, |sum, piece| {
                *sum += piece.area;
                Some(*sum)
            })
            .collect();
        let ray = |i: usize| {
            let [place, radius, angle] = lattice(i);
            let wanted = place * ends.last()?;
            let start = Start::new(job, pieces.get(ends.partition_point(|end| *end < wanted))?);
            let normal = scene.shape(lamp).surface.local(&start.anchors[0].point)?.n;
            // Evenly by flux: evenly over the disk that the hemisphere is over.
            let (s, t) = tangent_frame(&normal);
            let (sine, cosine) = math::sin_cos(TAU * angle);
            let direction =
                (s * cosine + t * sine) * radius.sqrt() + *normal * (1.0 - radius).sqrt();
            let hit =
                tracer.nearest(&Ray::new(start.x, direction), f64::INFINITY, &start.anchors)?;
            let surface = &scene.shape(hit.anchor.shape).surface;
            let front = surface.local(&hit.anchor.point)?.n.dot(&direction) < 0.0;
            let sheet = sheet_of(job.sheets, hit.anchor.shape, front)?;
            let site = surface.chart_point(&hit.anchor.point);
            Some(Landing { sheet, site, flux: flux / count as f64 })
        };
        (0..count).into_par_iter().filter_map(ray).collect::<Vec<_>>()
    };
    scene.lamps().flat_map(of_lamp).collect()
}

fn sheet_of(sheets: &[Sheet], shape: ShapeId, front: bool) -> Option<usize> {
    sheets.iter().position(|s| s.shape == shape && s.front == front)
}

/// What lands on sheets of the light of all lamps by specular chains.
pub(super) fn specular_landings(job: &Job<'_, '_>) -> Vec<Landing> {
    let (scene, tracer) = (job.scene, job.tracer);
    let starts: Vec<Piece> =
        scene.lamps().flat_map(|l| some(pieces(scene, l, 8), POINTS)).collect();
    let shapes = (0..scene.shapes.len() as u32).map(ShapeId);
    let specular: Vec<ShapeId> =
        shapes.filter(|id| scene.shape(*id).material.is_specular()).collect();
    let each = (RAYS / (starts.len() * specular.len()).max(1)).clamp(LEAST, MOST);
    let aims: Vec<Piece> = specular.into_iter().flat_map(|id| pieces(scene, id, each)).collect();
    let from = |start: &Piece| {
        let from = Start::new(job, start);
        aims.iter().flat_map(|aim| from.light(tracer, job.sheets, aim)).collect::<Vec<_>>()
    };
    starts.par_iter().flat_map_iter(from).collect()
}

/// A point of a lamp.
struct Start<'j, 's> {
    job: &'j Job<'j, 's>,
    x: Point3,
    lamp: ShapeId,
    anchors: Vec<Anchor>,
    area: f64,
}

impl<'j, 's> Start<'j, 's> {
    fn new(job: &'j Job<'j, 's>, piece: &Piece) -> Self {
        let point = job.scene.shape(piece.shape).surface.at_chart(&piece.site);
        let own = Anchor { shape: piece.shape, point };
        let others = job.tracer.contacts(&point.x).into_iter().filter(|a| a.shape != piece.shape);
        let anchors = std::iter::once(own).chain(others).collect();
        Self { job, x: point.x, lamp: piece.shape, anchors, area: piece.area }
    }

    /// What it sends to a piece of a specular surface, where that lands.
    fn light(&self, tracer: &Tracer<'_>, sheets: &[Sheet], aim: &Piece) -> Vec<Landing> {
        let scene = self.job.scene;
        let lamp = scene.shape(self.lamp);
        let surface = &scene.shape(aim.shape).surface;
        let target = surface.at_chart(&aim.site);
        let away = target.x - self.x;
        let distance = away.norm();
        let (Some(own), Some(there)) =
            (lamp.surface.local(&self.anchors[0].point), surface.local(&target))
        else {
            return Vec::new();
        };
        let direction = away / distance;
        let cosine = own.n.dot(&direction);
        if distance == 0.0 || cosine.is_nan() || cosine <= 0.0 {
            return Vec::new();
        }
        let ray = Ray::new(self.x, direction);
        let first = tracer.nearest(&ray, f64::INFINITY, &self.anchors);
        // What is met first by other rays is aimed at by those.
        let close = 1e-6 * (distance + surface.bounds().diagonal());
        if first.is_none_or(|hit| {
            hit.anchor.shape != aim.shape || (hit.anchor.point.x - target.x).norm() > close
        }) {
            return Vec::new();
        }
        let solid_angle = there.n.dot(&direction).abs() * aim.area / (distance * distance);
        let flux = lamp.radiance * (cosine * solid_angle * self.area);
        let trunk = Trunk { ray, length: f64::INFINITY, start: &self.anchors, travelled: 0.0 };
        let limits = super::limits(&self.job.settings.transfer);
        let leaves = sight(tracer, &trunk, &limits).leaves;
        let landing = |leaf: &crate::trace::tree::Leaf| {
            let sheet = sheet_of(sheets, leaf.anchor.shape, leaf.front)?;
            let site = scene.shape(leaf.anchor.shape).surface.chart_point(&leaf.anchor.point);
            Some(Landing { sheet, site, flux: (flux * leaf.flux).luminance() })
        };
        leaves.iter().filter_map(landing).collect()
    }
}
