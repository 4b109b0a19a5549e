//! The meeting of all ranks at the beginning of a call.

use tombolo_deform::communicator::{Communicator, RankError, Reduction, first_failure};
use tombolo_pipelines::{language::Command, run::Audience};

use crate::{
    error::ExecuteError,
    step::{Moment, Outside},
};

/// Finds out whether all ranks are at the same cycle and time and none has a fault, and whether
/// rank 0 was called to look at something, and what it knows of the world outside. One reduction of
/// seven numbers; a message more where there is a fault. Collective.
///
/// # Errors
/// One of these, on all ranks: [`ExecuteError::Cycles`], [`ExecuteError::Times`], or
/// [`ExecuteError::Rank`] or [`ExecuteError::Lent`] with the fault of the lowest rank that has one.
pub(crate) fn meet(
    communicator: &dyn Communicator,
    moment: Moment,
    fault: Option<ExecuteError>,
    called: bool,
    outside: Outside,
) -> Result<(bool, Outside), ExecuteError> {
    let told = fault.map(|fault| {
        let mut told = vec![u8::from(fault.is_of_lent())];
        told.extend_from_slice(fault.to_string().as_bytes());
        told
    });
    let (cycle, time) = (moment.cycle, position_of(moment.time));
    let is_first = communicator.rank() == 0;
    let called = if is_first { packed(called, outside) } else { 0 };
    let audience = if is_first { outside.audience.to_bits() } else { 0 };
    let mut said = [u64::from(told.is_some()), called, audience, cycle, !cycle, time, !time];
    communicator.reduce_integers(Reduction::Maximum, &mut said);
    let [failing, called, audience, highest, lowest, latest, earliest] = said;
    let (lowest, latest, earliest) = (!lowest, number_at(latest), number_at(!earliest));
    if failing > 0
        && let Some((rank, told)) = first_failure(communicator, 0, told)
    {
        let message = String::from_utf8_lossy(told.get(1..).unwrap_or_default()).into_owned();
        let error = RankError { rank, message };
        let is_of_lent = told.first() == Some(&1);
        return Err(if is_of_lent { ExecuteError::Lent(error) } else { error.into() });
    }
    if highest != lowest {
        return Err(ExecuteError::Cycles { lowest, highest });
    }
    if latest > earliest {
        return Err(ExecuteError::Times { cycle, earliest, latest });
    }
    Ok(unpacked(called, Audience::from_bits(audience)))
}

/// Bits of the count of viewers, behind one bit for the call; the milliseconds have the others.
const VIEWERS: u32 = 20;

fn packed(called: bool, Outside { seconds, viewers, .. }: Outside) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a conversion that saturates"
    )]
    let milliseconds = (seconds * 1e3) as u64;
    let viewers = viewers.min((1 << VIEWERS) - 1);
    milliseconds << (VIEWERS + 1) | viewers << 1 | u64::from(called)
}

fn unpacked(packed: u64, audience: Audience) -> (bool, Outside) {
    #[expect(clippy::cast_precision_loss, reason = "milliseconds below 2^43")]
    let seconds = (packed >> (VIEWERS + 1)) as f64 / 1e3;
    let viewers = packed >> 1 & ((1 << VIEWERS) - 1);
    (packed & 1 == 1, Outside { seconds, viewers, audience })
}

const SIGN: u64 = 1 << 63;

/// The position of a number among all, as an integer that is larger where the number is.
fn position_of(number: f64) -> u64 {
    let bits = number.to_bits();
    if bits & SIGN == 0 { bits | SIGN } else { !bits }
}

/// The number at a position among all.
fn number_at(position: u64) -> f64 {
    f64::from_bits(if position & SIGN == 0 { !position } else { position ^ SIGN })
}

/// Gives every rank the commands that rank 0 has taken in, so that they take effect at the same
/// cycle on all. Collective; free on one process.
///
/// # Errors
/// A text, on all ranks, where the commands cannot be read back.
pub(crate) fn share(
    communicator: &dyn Communicator,
    commands: Vec<(String, Command)>,
) -> Result<Vec<(String, Command)>, String> {
    if communicator.size() == 1 {
        return Ok(commands);
    }
    let mut bytes = if communicator.rank() == 0 {
        serde_json::to_vec(&commands).unwrap_or_default()
    } else {
        Vec::new()
    };
    communicator.broadcast(0, &mut bytes);
    // Every rank reads the same bytes, rank 0 too: what one cannot read, none obeys. Each command was
    // within its limits when it came in, and many together may be over those of one.
    serde_json::from_slice(&bytes)
        .map_err(|error| format!("commands were lost between ranks: {error}"))
}

#[cfg(test)]
mod tests {
    use serde_json::json;
    use tombolo_deform::communicator::threads;
    use tombolo_pipelines::{language::parse_json, limits::VALUES};

    use super::*;

    #[test]
    fn numbers_keep_their_order_as_integers() {
        let rising = [
            f64::NEG_INFINITY,
            -1e300,
            -1.0,
            -f64::MIN_POSITIVE,
            -0.0,
            0.0,
            1e-310,
            0.5,
            1e300,
            f64::INFINITY,
        ];
        assert!(rising.map(position_of).is_sorted());
        assert!(
            rising
                .iter()
                .all(|&number| number_at(position_of(number)).to_bits() == number.to_bits())
        );
    }

    #[test]
    fn faults_are_the_same_everywhere() {
        let at = |cycle: u64| Moment { cycle, time: 0.0 };
        let midplane = Audience::of(["midplane"]);
        let met = threads::run(3, |ranks| {
            let own = ranks.rank() as f64;
            let audience = if ranks.rank() == 0 { midplane } else { Audience::OF_ALL };
            let outside = Outside { seconds: 12.5 + own, viewers: 3, audience };
            meet(&ranks, at(4), None, ranks.rank() == 0, outside)
        });
        let of_first = (true, Outside { seconds: 12.5, viewers: 3, audience: midplane });
        assert!(met.into_iter().all(|met| met.is_ok_and(|met| met == of_first)));
        let said = threads::run(3, |ranks| {
            let fault = (ranks.rank() > 0).then_some(ExecuteError::NoChannel { cycle: 4 });
            meet(&ranks, at(4), fault, false, Outside::default()).unwrap_err().to_string()
        });
        assert!(
            said.iter().all(|said| said.starts_with("rank 1: cycle 4: no channel was given")),
            "{said:?}"
        );
        let said = threads::run(3, |ranks| {
            meet(&ranks, at(4 + ranks.rank() as u64), None, false, Outside::default())
                .unwrap_err()
                .to_string()
        });
        assert!(said.iter().all(|said| said.contains("from 4 to 6")), "{said:?}");
        let said = threads::run(3, |ranks| {
            let time = if ranks.rank() == 1 { 0.25 } else { 0.5 };
            meet(&ranks, Moment { cycle: 4, time }, None, false, Outside::default())
                .unwrap_err()
                .to_string()
        });
        assert!(said.iter().all(|said| said.contains("from 0.25 to 0.5")), "{said:?}");
    }

    #[test]
    fn commands_that_are_more_than_one_document_reach_all_ranks() {
        // Each is allowed, five values for each vertex; together they are more than one text may have.
        let vertices: Vec<usize> = (0..VALUES.most / 9).collect();
        let values = vec![[0.0; 3]; vertices.len()];
        let edit = json!({"displacement": {"vertices": vertices, "values": values}});
        let order = json!({"order": {"edits": [edit]}}).to_string();
        let shared = threads::run(2, |ranks| {
            let waiting = ["1", "2"].map(|id| (id, order.as_str()));
            let waiting = waiting.into_iter().chain([("3", r#"{"stop": {}}"#)]);
            let waiting = waiting
                .map(|(id, text)| (id.to_owned(), parse_json::<Command>(text, "message").unwrap()));
            let own = if ranks.rank() == 0 { waiting.collect() } else { Vec::new() };
            let shared = share(&ranks, own).unwrap();
            (shared.len(), matches!(shared.last(), Some((_, Command::Stop {}))))
        });
        assert_eq!(shared, [(3, true); 2]);
    }
}
