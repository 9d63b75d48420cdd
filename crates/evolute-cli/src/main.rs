//! The `evolute` program: one file per verb. The only place that prints.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod check;
mod export;
mod failure;
mod options;
mod points;
mod probe;
mod progress;
mod render;
mod session;
mod solution;
mod solve;
mod summary;
mod table;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::Failure;
use summary::Summary;

/// Where light goes in scenes with curved mirrors and lenses: deterministic, with an error figure.
#[derive(Parser)]
#[command(name = "evolute", version, arg_required_else_help = true, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

const EXAMPLES: &str = "\
Examples:
  evolute render                                  draws the built-in scene: room.exr and room.png
  evolute solve desk.xml -o desk.evolute          where light goes, for pictures and points later
  evolute probe desk.xml --points grid.csv        irradiance at the points of a table
  evolute check desk.xml                          reads a scene and says what is in it
  evolute export desk.xml -o desk_mitsuba         writes it in the words of Mitsuba 3 alone

Exit status: 0 done; 1 the input is wrong; 2 wrong command line; 3 stopped by a limit that was asked
for, the result is written; 130 interrupted.";

#[derive(Subcommand)]
enum Verb {
    Render(render::Arguments),
    Solve(solve::Arguments),
    Probe(probe::Arguments),
    Check(check::Arguments),
    Export(export::Arguments),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let (name, common) = match &cli.verb {
        Verb::Render(a) => ("render", &a.common),
        Verb::Solve(a) => ("solve", &a.common),
        Verb::Probe(a) => ("probe", &a.common),
        Verb::Check(a) => ("check", &a.common),
        Verb::Export(a) => ("export", &a.common),
    };
    let mut summary = Summary::new(name);
    let result = session::set_up(common).and_then(|()| match &cli.verb {
        Verb::Render(a) => render::run(a, &mut summary),
        Verb::Solve(a) => solve::run(a, &mut summary),
        Verb::Probe(a) => probe::run(a, &mut summary),
        Verb::Check(a) => check::run(a, &mut summary),
        Verb::Export(a) => export::run(a, &mut summary),
    });
    let status = match &result {
        Ok(()) => 0,
        Err(failure) => {
            eprintln!("{}", failure.message());
            summary.set("error", failure.text());
            failure.status()
        }
    };
    if matches!(result, Err(Failure::Usage(_))) {
        return ExitCode::from(status);
    }
    summary.finish(status, common);
    ExitCode::from(status)
}
