//! The end of a run, and of each run of a pipeline.

use tombolo_deform::communicator::{Communicator, Reduction};

use super::super::due::Now;
use super::super::history::Board;
use super::super::output::Output;
use super::prepare::Names;
use super::{Prepared, Seen};
use crate::language::{Action, Stage};

impl Prepared {
    /// Does what a pipeline does at the end of the run, where there are monitors and no mesh. Returns
    /// the values of the monitors.
    pub(crate) fn end(
        &mut self,
        cycle: u64,
        time: f64,
        communicator: &dyn Communicator,
        board: &Board,
        outputs: &mut Vec<Output>,
    ) -> Vec<f64> {
        #[expect(clippy::cast_precision_loss, reason = "cycles below 2^53")]
        let mut values = vec![cycle as f64, time];
        let is_first = communicator.rank() == 0;
        for (stage, names) in self.stages.iter().zip(&self.names) {
            let seen = Seen { cycle, time, values: &values, board, is_first };
            match (stage, names) {
                (Stage::Difference(_), Names::Difference(of, minus)) => {
                    let difference = seen.value(of) - seen.value(minus);
                    values.push(difference);
                }
                (Stage::Csv(_), _) => outputs.extend(self.row(names, &seen)),
                (Stage::Log(log), _) => outputs.extend(self.log(log, names, &seen)),
                _ => {}
            }
        }
        outputs.extend(self.told(cycle, time, &values[2..]));
        let seen = Seen { cycle, time, values: &values, board, is_first };
        let fires = self.trigger.fires((cycle, time), |slot| seen.value(slot));
        let actions = self.pipeline.then.iter().zip(&self.names_of_actions);
        for (action, names) in actions.filter(|_| fires) {
            match action {
                Action::Csv(_) => outputs.extend(self.row(names, &seen)),
                Action::Log(log) => outputs.extend(self.log(log, names, &seen)),
                // There is nobody any more to obey.
                _ => {}
            }
        }
        values.split_off(2)
    }

    /// Notes what a run has cost, by seconds of the clock; where the cadence changes for that, what
    /// there is to say. Rank 0 decides for all. Collective where the pipeline has a budget.
    pub(crate) fn ran(
        &mut self,
        now: &Now,
        begun: f64,
        ended: f64,
        communicator: &dyn Communicator,
    ) -> Option<String> {
        let seconds = (ended - begun).max(0.0);
        self.cost.ran(seconds);
        let rests = self.dormancy.only_shows() && !self.dormancy.is_watched(now);
        if !rests && !self.thinning.is_limited() {
            return None;
        }
        let mut told = if communicator.rank() == 0 { [seconds, ended] } else { [0.0; 2] };
        communicator.reduce(Reduction::Maximum, &mut told);
        if rests {
            self.dormancy.begin(now, told[0]);
            self.thinning.forget();
            return None;
        }
        self.thinning.ran(told[0], told[1])
    }
}
