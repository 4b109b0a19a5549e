//! `tombolo queue`.

use crate::{
    OrderReport, OrderStatus,
    client::{Drives, Event, Hello},
};

use super::{ANSWER, Target, connect, failed};
use crate::program::{Failure, say};

/// Lists the orders that have not begun to move the mesh, in their order.
pub(crate) fn queue(target: &Target) -> Result<(), Failure> {
    let client = connect(target, Drives::Never)?;
    loop {
        let Some(received) = client.next(ANSWER).map_err(failed)? else {
            return Err(Failure::Wrong("the run tells nothing".into()));
        };
        if let Event::Hello(hello) = received.event {
            return list(&hello, target.json);
        }
    }
}

fn list(hello: &Hello, as_json: bool) -> Result<(), Failure> {
    let waits = |order: &&OrderReport| {
        matches!(order.status, OrderStatus::Accepted | OrderStatus::Computing)
    };
    let mut waiting = hello.orders.iter().filter(waits).peekable();
    if waiting.peek().is_none() && !as_json {
        return say("no order waits");
    }
    for order in waiting {
        match as_json {
            true => say(serde_json::json!({ "order": order }))?,
            false => say(line(order))?,
        }
    }
    Ok(())
}

/// Why an order waits and since when, in one line.
fn line(order: &OrderReport) -> String {
    let why = match (order.status, &order.waits_for) {
        (OrderStatus::Computing, None) => "its shapes are being found".into(),
        (_, Some(reason)) => format!("waits for {reason}"),
        (_, None) => "waits for its turn".into(),
    };
    format!("order {}: {why}, since cycle {}", order.id, order.cycle_accepted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_why_and_since_when() {
        let order = OrderReport {
            id: "c1-7".into(),
            waits_for: Some("order o2, which came before it".into()),
            cycle_accepted: 121,
            ..OrderReport::default()
        };
        assert_eq!(
            line(&order),
            "order c1-7: waits for order o2, which came before it, since cycle 121"
        );
    }
}
