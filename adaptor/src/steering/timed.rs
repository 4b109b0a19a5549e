//! Commands that were given beforehand.

use std::collections::HashMap;

use tombolo_pipelines::language::{At, Command, Order, TimedCommand};

use crate::{fingerprint::hash, step::Moment};

/// Commands that are not due yet, in the order in which they were given.
#[derive(Debug)]
pub(crate) struct Timed {
    commands: Vec<TimedCommand>,
    /// The hashes of the commands that were carried out, also in the run before.
    carried_out: Vec<u64>,
    /// The least of the cycles and of the times at which one is due.
    cycle: u64,
    time: f64,
}

impl Timed {
    /// Commands that are not due yet; `carried_out` are the hashes of those that were.
    pub(crate) fn new(commands: Vec<TimedCommand>, carried_out: Vec<u64>) -> Self {
        let mut timed = Self { commands, carried_out, cycle: u64::MAX, time: f64::INFINITY };
        timed.look_ahead();
        timed
    }

    fn look_ahead(&mut self) {
        (self.cycle, self.time) = (u64::MAX, f64::INFINITY);
        for command in &self.commands {
            match command.at {
                None => self.cycle = 0,
                Some(At::Cycle(cycle)) => self.cycle = self.cycle.min(cycle),
                Some(At::Time(time)) => self.time = self.time.min(time),
            }
        }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.commands.is_empty()
    }

    /// Those that were not given yet.
    pub(crate) fn left(&self) -> &[TimedCommand] {
        &self.commands
    }

    /// The hashes of the commands that were carried out, also in the run before.
    pub(crate) fn carried_out(&self) -> &[u64] {
        &self.carried_out
    }

    /// The next order, as far as that can be known.
    pub(crate) fn next_order(&self) -> Option<&Order> {
        let cycle = |command: &TimedCommand| match command.at {
            None => (0, 0.0),
            Some(At::Cycle(cycle)) => (cycle, 0.0),
            Some(At::Time(time)) => (u64::MAX, time),
        };
        let orders = self.commands.iter().filter_map(|command| match &command.command {
            Command::Order(order) => Some((cycle(command), order)),
            _ => None,
        });
        orders
            .min_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)))
            .map(|(_, order)| order)
    }

    /// Whether any order drags the skeleton.
    pub(crate) fn drags_skeleton(&self) -> bool {
        self.commands
            .iter()
            .any(|timed| matches!(&timed.command, Command::Order(order) if order.drags_skeleton()))
    }

    /// Whether [`Timed::take_due`] would find one; two comparisons.
    #[inline]
    pub(crate) fn is_due(&self, moment: Moment) -> bool {
        !self.commands.is_empty()
            && (moment.cycle >= self.cycle
                || At::Time(self.time).has_come(moment.cycle, moment.time))
    }

    /// The commands that are due, in the order in which they were given; each is given once.
    pub(crate) fn take_due(&mut self, moment: Moment) -> Vec<TimedCommand> {
        if !self.is_due(moment) {
            return Vec::new();
        }
        let has_come = |command: &TimedCommand| {
            command.at.is_none_or(|at| at.has_come(moment.cycle, moment.time))
        };
        let (due, rest) = std::mem::take(&mut self.commands).into_iter().partition(has_come);
        self.commands = rest;
        self.carried_out.extend(due.iter().map(|command| hash_of(std::slice::from_ref(command))));
        self.look_ahead();
        due
    }
}

/// A hash by which lists of commands are told apart.
pub(crate) fn hash_of(commands: &[TimedCommand]) -> u64 {
    hash(serde_json::to_vec(commands).unwrap_or_default())
}

/// The commands of a file without those that a run has carried out. Where the file has two that are alike
/// and one was carried out, the other stays.
pub(crate) fn without_carried_out(
    commands: Vec<TimedCommand>,
    carried_out: &[u64],
) -> Vec<TimedCommand> {
    let mut counts = HashMap::<u64, usize>::new();
    carried_out.iter().for_each(|&hash| *counts.entry(hash).or_default() += 1);
    let is_left =
        |command: &TimedCommand| match counts.get_mut(&hash_of(std::slice::from_ref(command))) {
            Some(count) if *count > 0 => {
                *count -= 1;
                false
            }
            _ => true,
        };
    commands.into_iter().filter(is_left).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(at: Option<At>) -> TimedCommand {
        TimedCommand { at, id: None, command: Command::Stop {} }
    }

    #[test]
    fn each_command_is_given_once_when_its_moment_has_come() {
        let moments = [Some(At::Cycle(3)), None, Some(At::Time(0.5)), Some(At::Cycle(3))];
        let mut timed = Timed::new(moments.map(at).to_vec(), Vec::new());
        let mut given = Vec::new();
        for cycle in 0..20 {
            let moment = Moment { cycle, time: f64::from(cycle as u32) * 0.1 };
            assert_eq!(timed.is_due(moment), [0, 3, 5].contains(&cycle));
            given.extend(timed.take_due(moment).into_iter().map(|command| (cycle, command.at)));
        }
        assert_eq!(
            given,
            [(0, None), (3, Some(At::Cycle(3))), (3, Some(At::Cycle(3))), (5, Some(At::Time(0.5)))]
        );
        assert!(timed.is_empty());
        assert_eq!(timed.carried_out().len(), 4);
    }

    #[test]
    fn of_a_file_that_was_changed_what_was_given_is_not_given_again() {
        let [early, late] = [at(Some(At::Cycle(3))), at(Some(At::Cycle(9)))];
        let mut timed = Timed::new(vec![early.clone(), early.clone(), late.clone()], Vec::new());
        timed.take_due(Moment { cycle: 5, time: 0.0 });
        let new = at(None);
        let changed = vec![early.clone(), new.clone(), early.clone(), early.clone(), late.clone()];
        assert_eq!(without_carried_out(changed, timed.carried_out()), [new, early, late]);
    }
}
