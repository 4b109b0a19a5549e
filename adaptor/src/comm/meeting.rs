//! How the ranks come together at the beginning of a call.

use tombolo_pipelines::communicator::{Communicator, RankError, Reduction};

use crate::{settings::ExecuteError, steering::Moment};

/// Finds out whether all ranks are at the same cycle and time and none has a fault, and whether rank 0 was called to look at
/// something. One reduction of six numbers; a message more where there is a fault. Collective.
///
/// # Errors
/// The same on all ranks: [`ExecuteError::Cycles`], [`ExecuteError::Times`], or [`ExecuteError::Rank`] with the fault of the lowest rank that has one.
pub(crate) fn meet(
    communicator: &dyn Communicator,
    moment: Moment,
    fault: Option<ExecuteError>,
    called: bool,
) -> Result<bool, ExecuteError> {
    let (rank, size) = (communicator.rank(), communicator.size());
    #[expect(clippy::cast_precision_loss, reason = "ranks and cycles below 2^53")]
    let (failing, cycle) =
        (if fault.is_some() { (size - rank) as f64 } else { 0.0 }, moment.cycle as f64);
    let mut said = [
        failing,
        cycle,
        -cycle,
        moment.time,
        -moment.time,
        f64::from(u8::from(called && rank == 0)),
    ];
    communicator.reduce(Reduction::Maximum, &mut said);
    let [failing, highest, lowest, latest, earliest, called] = said;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts")]
    let (failing, highest, lowest) = (failing as usize, highest as u64, -lowest as u64);
    if failing > 0 {
        let failing = size.saturating_sub(failing);
        let message = fault.map(|fault| fault.to_string()).unwrap_or_default();
        let mut bytes = if rank == failing { message.into_bytes() } else { Vec::new() };
        communicator.broadcast(failing, &mut bytes);
        let message = String::from_utf8_lossy(&bytes).into_owned();
        return Err(RankError { rank: failing, message }.into());
    }
    if highest != lowest {
        return Err(ExecuteError::Cycles { lowest, highest });
    }
    if latest > -earliest {
        return Err(ExecuteError::Times { cycle: moment.cycle, earliest: -earliest, latest });
    }
    Ok(called > 0.0)
}

#[cfg(test)]
mod tests {
    use tombolo_pipelines::communicator::threads;

    use super::*;

    #[test]
    fn faults_are_the_same_everywhere() {
        let at = |cycle: u64| Moment { cycle, time: 0.0 };
        let met = threads::run(3, |ranks| meet(&ranks, at(4), None, ranks.rank() == 0));
        assert!(met.into_iter().all(|called| called.is_ok_and(|called| called)));
        let said = threads::run(3, |ranks| {
            let fault = (ranks.rank() > 0).then_some(ExecuteError::NoChannel { cycle: 4 });
            meet(&ranks, at(4), fault, false).unwrap_err().to_string()
        });
        assert!(
            said.iter().all(|said| said.starts_with("rank 1: cycle 4: no channel was given")),
            "{said:?}"
        );
        let said = threads::run(3, |ranks| {
            meet(&ranks, at(4 + ranks.rank() as u64), None, false).unwrap_err().to_string()
        });
        assert!(said.iter().all(|said| said.contains("from 4 to 6")), "{said:?}");
        let said = threads::run(3, |ranks| {
            let time = if ranks.rank() == 1 { 0.25 } else { 0.5 };
            meet(&ranks, Moment { cycle: 4, time }, None, false).unwrap_err().to_string()
        });
        assert!(said.iter().all(|said| said.contains("from 0.25 to 0.5")), "{said:?}");
    }
}
