//! Scenes with one byte changed load or are refused, and nothing else: no panic, no runaway memory.
#![allow(clippy::unwrap_used, clippy::print_stderr, missing_docs)]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use evolute::scene::load_file;

/// Mutations of each scene.
const MUTATIONS: usize = 1_000;

/// A small generator of pseudo-random numbers (Vigna, splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// The scenes of `cases/`, but the bad ones.
fn scenes() -> Vec<PathBuf> {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    let mut scenes: Vec<PathBuf> = std::fs::read_dir(cases)
        .unwrap()
        .map(|entry| entry.unwrap().path().join("scene.xml"))
        .filter(|path| path.is_file())
        .collect();
    scenes.sort();
    scenes
}

#[test]
fn one_changed_byte_never_panics() {
    let scenes = scenes();
    assert!(scenes.len() >= 3);
    for path in scenes {
        // Beside copies of its neighbours, so that what it includes is found.
        let folder = path.parent().unwrap();
        let beside = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder.file_name().unwrap());
        std::fs::create_dir_all(&beside).unwrap();
        for entry in std::fs::read_dir(folder).unwrap() {
            let file = entry.unwrap().path();
            if file.is_file() {
                std::fs::copy(&file, beside.join(file.file_name().unwrap())).unwrap();
            }
        }
        let mutation = beside.join("mutation.xml");
        let good = std::fs::read(&path).unwrap();
        load_file(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
        let mut random = Random(20);
        let numbers: Vec<usize> = (0..good.len()).filter(|i| good[*i].is_ascii_digit()).collect();
        let (mut fine, mut slowest) = (0, Duration::ZERO);
        for _ in 0..MUTATIONS {
            let mut changed = good.clone();
            let mut put = |at: usize, byte: u8| changed[at] = byte;
            match random.below(3) {
                0 => put(random.below(good.len()), random.next() as u8),
                // The characters that XML and formulas live by.
                1 => {
                    let likely = b"0123456789.-+eE<>/\"'=&$#; \n\tstxyzp*^(),";
                    put(random.below(good.len()), likely[random.below(likely.len())]);
                }
                // Another number, huge, tiny or negative at times.
                _ => {
                    let likely = b"0123456789.-e";
                    put(numbers[random.below(numbers.len())], likely[random.below(likely.len())]);
                }
            }
            std::fs::write(&mutation, &changed).unwrap();
            let start = Instant::now();
            match load_file(&mutation, &[]) {
                Ok(_) => fine += 1,
                Err(error) => {
                    let message = error.to_string();
                    assert!(message.starts_with("error: ") && message.len() < 4_000, "{message}");
                    assert!(error.location().is_some(), "no place: {message}");
                }
            }
            slowest = slowest.max(start.elapsed());
        }
        // A mutation that was never noticed, or always, would be a test of nothing.
        assert!(fine > MUTATIONS / 10 && fine < MUTATIONS * 9 / 10, "{path:?}: {fine}");
        assert!(slowest < Duration::from_secs(20), "{path:?}: {slowest:?}");
        eprintln!("{path:?}: {fine} of {MUTATIONS} load, the slowest took {slowest:?}");
    }
    if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
        let line = status.lines().find(|l| l.starts_with("VmHWM:")).unwrap();
        let kilobytes: u64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
        assert!(kilobytes < 200 * 1024, "{kilobytes} kB");
    }
}
