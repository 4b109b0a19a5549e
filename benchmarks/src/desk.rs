//! Two machines on one: the last core is the engineer's desk, and the run has the others.
//!
//! A viewer computes on a machine of its own. On a machine of few cores it would take processor time
//! from the run, and what the run pays for being watched could not be told from that.

use std::{
    error::Error,
    fs,
    process::{self, Command},
};

use crate::peer;

/// The core that stands for the machine of the engineer.
#[derive(Clone, Debug)]
pub struct Desk {
    /// The last core; none where there is one alone.
    core: Option<usize>,
    /// All cores that this process was given, as a list for `taskset`.
    cores: String,
}

impl Desk {
    /// Keeps this process, and all that it starts, off the core of the desk. Call it before anything that
    /// starts threads: a pool has as many as it finds cores.
    ///
    /// # Errors
    /// Where the program `taskset` is missing or fails.
    pub fn set_apart() -> Result<Self, Box<dyn Error>> {
        let own = process::id().to_string();
        // Such as "pid 42's current affinity list: 0-3,8".
        let told = peer::run(Command::new("taskset").args(["--pid", "--cpu-list", &own]))?;
        let allowed = told.trim().rsplit(' ').next().unwrap_or_default();
        let mut cores = Vec::new();
        for range in allowed.split(',') {
            let (first, last) = range.split_once('-').unwrap_or((range, range));
            cores.extend(first.parse::<usize>()?..=last.parse()?);
        }
        let Some((&last, others)) = cores.split_last().filter(|(_, others)| !others.is_empty())
        else {
            return Ok(Self { core: None, cores: allowed.into() });
        };
        let others: Vec<String> = others.iter().map(usize::to_string).collect();
        let arguments = ["--all-tasks", "--pid", "--cpu-list", &others.join(","), &own];
        peer::run(Command::new("taskset").args(arguments))?;
        Ok(Self { core: Some(last), cores: allowed.into() })
    }

    /// Lets the threads of this process whose names begin with `names` run on the core of the desk too,
    /// as where a run has a core free beside those of its solver.
    ///
    /// # Errors
    /// Where the threads cannot be listed, or the program `taskset` fails.
    pub fn let_in(&self, names: &str) -> Result<(), Box<dyn Error>> {
        if self.core.is_none() {
            return Ok(());
        }
        for thread in fs::read_dir("/proc/self/task")? {
            let thread = thread?;
            if !fs::read_to_string(thread.path().join("comm"))?.starts_with(names) {
                continue;
            }
            let id = thread.file_name();
            let mut all = Command::new("taskset");
            all.args(["--pid", "--cpu-list", &self.cores]).arg(id);
            peer::run(&mut all)?;
        }
        Ok(())
    }

    /// A program on the core of the desk; where there is none, with the lowest priority.
    pub fn command(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let (before, arguments) = match self.core {
            Some(core) => ("taskset", ["--cpu-list".to_owned(), core.to_string()]),
            None => ("nice", ["-n".to_owned(), "19".to_owned()]),
        };
        let mut command = Command::new(before);
        command.args(arguments).arg(program);
        command
    }

    /// The words of a report for where programs at the desk run.
    pub fn description(&self) -> &'static str {
        match self.core {
            Some(_) => "on a core of its own",
            None => "on the core of the run, with the lowest priority",
        }
    }
}
