//! Damaged input for every reader of Tombolo: files, messages of the network, checkpoints.
//!
//! ```text
//! cargo run --release -p tombolo-fuzz -- orders --seconds 60
//! ```
//!
//! A [`Target`] has sound inputs, its seeds, and a check. [`fuzz`] damages them by chance, and the
//! check reads what came of it. It must end within [`LONGEST`], without a panic, without an
//! allocation that the system refuses, and what it reads must keep the promises of the target: what
//! was read is the same when it was written and read again, for one. An input whose outcome was not
//! seen before (its error, without the numbers in it) is damaged further, which leads deep into the
//! readers without an instrumented compiler.
//!
//! Each input is written to a file before it is read, so that one that ends the process is there
//! too. `corpus/TARGET.zst` holds inputs of before: each had an outcome that none before it had. Every
//! pass begins with them and goes on from them; [`fuzz`] can add its own.
#![warn(missing_docs)]

mod client;
mod corpus;
mod damage;
mod meshes;
mod random;
mod relay;
mod seeds;
mod server;
mod target;

use std::{
    collections::{HashSet, hash_map::DefaultHasher},
    fs,
    hash::{Hash, Hasher},
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use random::Random;
pub use seeds::Seeds;
pub use target::Target;

/// The longest that a reader may take for an input.
pub const LONGEST: Duration = Duration::from_secs(30);
/// Inputs that are read however long they take.
const LEAST: u64 = 16;
/// Bytes that an input may grow to.
const MOST_BYTES: usize = 1 << 20;
/// Inputs with an outcome of their own that are damaged further.
const MOST_KEPT: usize = 4096;

/// The outcome of a pass without a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pass {
    /// How many inputs were read.
    pub inputs: u64,
    /// How many different outcomes they had.
    pub outcomes: usize,
}

/// An input that does harm.
#[derive(Debug)]
pub struct Fault {
    /// The harm.
    pub reason: String,
    /// The file that holds the input.
    pub file: PathBuf,
}

/// Reads one input; whether it did harm.
struct Reading<'s> {
    target: Target,
    seeds: &'s Seeds,
    current: PathBuf,
}

impl Reading<'_> {
    /// The outcome without its numbers.
    fn outcome(&self, input: &[u8]) -> Result<u64, String> {
        fs::write(&self.current, input).map_err(|error| error.to_string())?;
        let begun = Instant::now();
        let read = catch_unwind(AssertUnwindSafe(|| self.target.check(self.seeds, input)));
        let outcome = read.unwrap_or_else(|panic| {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or(panic.downcast_ref::<&str>().copied());
            Err(format!("it panics: {}", text.unwrap_or("without a text")))
        })?;
        if begun.elapsed() > LONGEST {
            return Err(format!("it takes {:.1} s", begun.elapsed().as_secs_f64()));
        }
        let mut hasher = DefaultHasher::new();
        outcome.chars().filter(|c| !c.is_ascii_digit()).collect::<String>().hash(&mut hasher);
        Ok(hasher.finish())
    }
}

/// Has a target read damaged inputs for so long; the first that does harm is left in a file in
/// `folder`. Where it `adds` to the corpus, inputs with an outcome of their own are kept there, and
/// those of before that have none any more are not.
///
/// # Errors
/// A [`Fault`]; a folder or a corpus that cannot be read or written is one too.
pub fn fuzz(
    target: Target,
    seed: u64,
    time: Duration,
    folder: &Path,
    adds: bool,
) -> Result<Pass, Fault> {
    let current = folder.join(format!("{}.input", target.name()));
    let fault = |reason: String| Fault { reason, file: current.clone() };
    let failed = |error: io::Error| fault(error.to_string());
    fs::create_dir_all(folder).map_err(failed)?;
    let seeds = Seeds::new().map_err(fault)?;
    let reading = Reading { target, seeds: &seeds, current: current.clone() };
    let mut random = Random::new(seed);
    let mut kept = target.seeds(&seeds);
    let (mut seen, mut inputs) = (HashSet::new(), 0);
    for input in &kept {
        seen.insert(reading.outcome(input).map_err(fault)?);
        inputs += 1;
    }
    let own = kept.len();
    for input in corpus::read(target).map_err(failed)? {
        inputs += 1;
        if seen.insert(reading.outcome(&input).map_err(fault)?) {
            kept.push(input);
        }
    }
    let until = Instant::now() + time;
    while inputs < LEAST || Instant::now() < until {
        let mut input = random.choose(&kept).cloned().unwrap_or_default();
        let other = random.choose(&kept).cloned().unwrap_or_default();
        for _ in 0..=random.below(4) {
            damage::damage(&mut input, &other, target.is_text(), &mut random);
        }
        input.truncate(MOST_BYTES);
        target.seal(&mut input, &mut random);
        inputs += 1;
        if seen.insert(reading.outcome(&input).map_err(fault)?) && kept.len() < MOST_KEPT {
            kept.push(input);
        }
    }
    if adds {
        corpus::write(target, kept.split_off(own)).map_err(failed)?;
    }
    Ok(Pass { inputs, outcomes: seen.len() })
}
