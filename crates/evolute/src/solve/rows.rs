//! What every vertex sees, gathered once.

use rayon::prelude::*;

use super::Solver;
use super::balance::balance;
use super::transport::{BoundRow, Fate, Transport};
use crate::geometry::Rgb;
use crate::trace::Tracer;
use crate::trace::tree::Leaf;
use crate::transfer::{HemisphereSettings, gather};

/// Part of the tolerance that is for the cubature of reflected light.
const GATHERING: f64 = 0.25;

/// Most samples of a row.
const MAX_SAMPLES: usize = 20_000;

impl Solver<'_> {
    /// Mean irradiance of diffuse surfaces that reflected light must come to, roughly [W/m²].
    fn ambient(&self) -> Rgb {
        let solution = &self.solution;
        let area: f64 = solution.area.iter().sum();
        let mut reflectance = Rgb::BLACK;
        for (r, a) in solution.reflectance.iter().zip(&solution.area) {
            reflectance += *r * (*a / area);
        }
        let first = self.ledger.unshot * (1.0 / area);
        Rgb(std::array::from_fn(|i| first[i] / (1.0 - reflectance[i].min(0.99))))
    }

    /// Gathers rows, finely enough for the light that lamps throw on all surfaces and what it comes to.
    pub(super) fn gather_rows(&mut self, tracer: &Tracer<'_>) {
        let ambient = self.ambient();
        let limits = self.limits();
        let transfer = &self.settings.transfer;
        let solution = &self.solution;
        let lamps: Vec<Rgb> = solution.lamp_light().collect();
        let vertices: Vec<(usize, u32, u32)> = solution.vertices().collect();
        let radiosity = |leaf: &Leaf| {
            let known = solution.radiosity_seen(tracer.scene(), leaf);
            known.map_or(Rgb::BLACK, |b| b + leaf.reflectance * ambient)
        };
        let rows: Vec<(BoundRow, Fate, u64)> = vertices
            .par_iter()
            .map(|&(sheet, vertex, number)| {
                let (receiver, start) = solution.sheets()[sheet].receiver(tracer, vertex);
                let expected = (lamps[number as usize] + ambient).luminance();
                let tolerance = (GATHERING * transfer.relative * expected).max(transfer.absolute);
                let settings = HemisphereSettings { limits, tolerance, max_samples: MAX_SAMPLES };
                let gathered = gather(tracer, &receiver, &start, &radiosity, &settings);
                let bound = BoundRow::new(&gathered.row, &|link| {
                    solution.locate(link.shape, link.front, &link.site)
                });
                (bound, Fate::new(&gathered.row), gathered.rays)
            })
            .collect();
        let (mut bound, mut fates) =
            (Vec::with_capacity(rows.len()), Vec::with_capacity(rows.len()));
        for (row, fate, rays) in rows {
            bound.push(row);
            fates.push(fate);
            self.counts.rays += rays;
        }
        self.counts.balance = balance(&mut bound, &fates, &solution.patches, &solution.area);
        self.transport = Transport::new(solution.patches.len(), &bound, fates);
        self.counts.links = self.transport.counts();
    }
}
