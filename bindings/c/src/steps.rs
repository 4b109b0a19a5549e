//! `tombolo_execute` and what it gives back.

use std::ffi::{c_char, c_int, c_uint};
use std::ptr;

use tombolo::deform::mesh::Vector;
use tombolo::foreign::{Run, RunError, Shown};
use tombolo::pipelines::language::nearest;
use tombolo::{ExecuteError, MeshMotion, OrderReport, Step};

use crate::ending::Ending;
use crate::export::{Out, Text, export};
use crate::{Fault, Handle, Opened, Stage, c_string, find, try_hold, with};

/// Something of the motion that is asked for; `none` where the mesh stays.
fn motion<T>(
    run: *mut Handle,
    none: T,
    part: impl FnOnce(&MeshMotion, &Opened) -> T,
) -> Result<T, Fault> {
    with(run, |run| {
        Ok(run.under_way()?.asked().motion.as_ref().map_or(none, |motion| part(motion, run)))
    })
}

fn first(vectors: &[Vector]) -> *const f64 {
    vectors.as_ptr().cast()
}

fn orders(run: &Opened) -> Vec<OrderReport> {
    match (&run.stage, &run.report) {
        (Stage::UnderWay(under_way), _) => under_way.orders(),
        (_, Some((report, _))) => report.orders.clone(),
        _ => Vec::new(),
    }
}

/// Refuses what was a negative number before it became one without a sign, as Fortran's are.
fn check_cycle(cycle: u64) -> Result<(), RunError> {
    match cycle.cast_signed() {
        0.. => Ok(()),
        negative => Err(RunError::Step {
            what: "cycle",
            found: negative.to_string(),
            expected: "a whole number from 0 on",
        }),
    }
}

/// Does something that all ranks do together with a text that each is given. One whose own makes no
/// sense says so to the others, which would wait for it, and is answered for its own mistake.
fn on_all(
    run: *mut Handle,
    text: Result<String, Fault>,
    call: impl FnOnce(&mut Run, Result<String, RunError>) -> Result<(), RunError>,
) -> Result<(), Fault> {
    with(run, |run| {
        run.under_way()?;
        let (told, wrong_call) = match text {
            Ok(text) => (Ok(text), None),
            Err(Fault::Error(error)) => (Err(error), None),
            Err(Fault::Call(message)) => {
                (Err(RunError::Configuration(message.clone())), Some(message))
            }
        };
        let done = call(run.begin()?, told);
        wrong_call.map_or(Ok(()), |message| Err(Fault::Call(message)))?;
        Ok(done?)
    })
}

export! {
    fn tombolo_execute(run: *mut Handle, cycle: u64, time: f64, time_step: f64) {
        with(run, |run| {
            run.begin()?;
            run.orders.clear();
            let Stage::UnderWay(under_way) = &mut run.stage else { return Err(Opened::after_the_end()) };
            let _alarm = under_way.alarm();
            let step = Step { cycle, time, time_step };
            // Refused with what else is wrong on one rank: the others would wait for it.
            let given = check_cycle(cycle).and_then(|()| {
                let there = run.channels.iter().filter(|named| !named.is_forgotten);
                // SAFETY: as the crate's page says: the arrays live while this call runs.
                let channels = there.map(|named| unsafe { named.channel() });
                let channels = channels.collect::<Result<_, _>>()?;
                Ok(Shown { step, looked_at: under_way.looks_at(&step), channels })
            });
            if !under_way.execute(given)? {
                return Err(ExecuteError::NoChannel { cycle }.into());
            }
            let there = run.channels.iter_mut().filter(|named| !named.is_forgotten);
            there.for_each(|named| named.is_shown = true);
            let order = under_way.asked().motion.as_ref().map(|motion| motion.order.as_str());
            if let Some(order) = order.filter(|order| run.motion_order.to_bytes() != order.as_bytes()) {
                run.motion_order = c_string(order);
            }
            Ok(())
        })
    }

    fn tombolo_checkpoint(run: *mut Handle, file: Text) {
        on_all(run, file.get("file"), |run, file| run.checkpoint(file.map(Some), "file"))
    }

    fn tombolo_coordinates(run: *mut Handle) -> (*const f64 = ptr::null()) {
        motion(run, ptr::null(), |motion, _| first(&motion.coordinates))
    }

    fn tombolo_displacement(run: *mut Handle) -> (*const f64 = ptr::null()) {
        motion(run, ptr::null(), |motion, _| first(&motion.displacement))
    }

    fn tombolo_velocity(run: *mut Handle) -> (*const f64 = ptr::null()) {
        motion(run, ptr::null(), |motion, _| first(&motion.velocity))
    }

    fn tombolo_motion_count(run: *mut Handle) -> (usize = 0) {
        motion(run, 0, |motion, _| motion.coordinates.len())
    }

    fn tombolo_surface_coordinates(run: *mut Handle) -> (*const f64 = ptr::null()) {
        motion(run, ptr::null(), |motion, _| first(&motion.surface.coordinates))
    }

    fn tombolo_surface_displacement(run: *mut Handle) -> (*const f64 = ptr::null()) {
        motion(run, ptr::null(), |motion, _| first(&motion.surface.displacement))
    }

    fn tombolo_surface_velocity(run: *mut Handle) -> (*const f64 = ptr::null()) {
        motion(run, ptr::null(), |motion, _| first(&motion.surface.velocity))
    }

    fn tombolo_surface_vertices(run: *mut Handle) -> (*const u32 = ptr::null()) {
        motion(run, ptr::null(), |motion, _| motion.surface.vertices.as_ptr())
    }

    fn tombolo_surface_count(run: *mut Handle) -> (usize = 0) {
        motion(run, 0, |motion, _| motion.surface.vertices.len())
    }

    fn tombolo_motion_order(run: *mut Handle) -> (*const c_char = ptr::null()) {
        motion(run, ptr::null(), |_, run| run.motion_order.as_ptr())
    }

    fn tombolo_motion_shape(run: *mut Handle, shape: Out<c_uint>, shapes: Out<c_uint>) {
        let (shape, shapes) = (shape.get("shape or shapes")?, shapes.get("shape or shapes")?);
        (*shape, *shapes) = (0, 0);
        (*shape, *shapes) = motion(run, (0, 0), |motion, _| motion.shape)?;
        Ok(())
    }

    fn tombolo_parameter_value(run: *mut Handle, name: Text, value: Out<f64>) {
        let (name, value) = (name.get("the parameter's name")?, value.get("value")?);
        with(run, |run| {
            let known = &run.under_way()?.asked().parameters;
            *value = *known.get(&name).ok_or_else(|| {
                let names = known.keys().map(String::as_str);
                let expected = match nearest(&name, names.clone()) {
                    Some(near) => format!("one that tombolo_parameter declared; did you mean '{near}'?"),
                    None if known.is_empty() => "one that tombolo_parameter declared; none was".into(),
                    None => format!("one of: {}", names.collect::<Vec<_>>().join(", ")),
                };
                Fault::invalid("parameter", format!("'{name}'"), expected)
            })?;
            Ok(())
        })
    }

    fn tombolo_release_shape(run: *mut Handle, reason: Text) {
        on_all(run, reason.name("the reason"), Run::release_shape)
    }

    fn tombolo_stop(run: *mut Handle) {
        Ending::of(&find(run)?.ending).ask()
    }

    fn tombolo_stopped(run: *mut Handle) -> (c_int = 1) {
        let entry = find(run)?;
        // Another thread is in a call, perhaps in one that waits: the run goes on.
        let Some(run) = try_hold(&entry.run) else { return Ok(0) };
        // A solver whose run is not there any more is not to go on for ever.
        Ok(match &run.stage {
            // What was asked of this rank alone, all learn in the first `tombolo_execute`.
            Stage::Opened(_) => 0,
            Stage::UnderWay(under_way) => c_int::from(under_way.asked().stop),
            Stage::Ended => 1,
        })
    }

    fn tombolo_order_count(run: *mut Handle) -> (usize = 0) {
        with(run, |run| Ok(orders(run).len()))
    }

    fn tombolo_order(run: *mut Handle, index: usize) -> (*const c_char = ptr::null()) {
        order(run, Some(index), |count| {
            let expected = match count {
                0 => "no index, as there are no orders".into(),
                _ => format!("an index from 0 to {}", count - 1),
            };
            Fault::invalid("order", index, expected)
        })
    }

    fn tombolo_order_by_number(run: *mut Handle, number: i64) -> (*const c_char = ptr::null()) {
        let index = number.checked_sub(1).and_then(|index| usize::try_from(index).ok());
        order(run, index, |count| {
            let expected = match count {
                0 => "no number, as there are no orders".into(),
                _ => format!("a number from 1 to {count}"),
            };
            Fault::invalid("order", number, expected)
        })
    }
}

/// What became of the order at this index, as a text; `missing` says of how many orders it is none.
fn order(
    run: *mut Handle,
    index: Option<usize>,
    missing: impl FnOnce(usize) -> Fault,
) -> Result<*const c_char, Fault> {
    with(run, |run| {
        let orders = orders(run);
        let found = index.and_then(|index| Some((index, orders.get(index)?)));
        let (index, order) = found.ok_or_else(|| missing(orders.len()))?;
        let text = c_string(&serde_json::to_string(order).unwrap_or_default());
        // A caller may hold the address of the text that was given before: it is replaced only
        // where the order went on.
        let kept = run.orders.entry(index).or_default();
        if *kept != text {
            *kept = text;
        }
        Ok(kept.as_ptr())
    })
}
