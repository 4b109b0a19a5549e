//! `tombolo_execute` and what it gives back.

use std::ffi::{c_char, c_int, c_uint};
use std::ptr;

use tombolo::deform::mesh::Vector;
use tombolo::{OrderReport, Step};

use super::{Fault, Handle, Stage, answer, give, handle, shared, text};
use crate::motion::Motion;
use crate::run::Run;

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_execute(run: *mut Handle, cycle: u64, time: f64, time_step: f64) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let run = unsafe { handle(run) }?;
        let Stage::UnderWay(under_way) = &mut run.stage else {
            return Err(Fault::Call("called outside of tombolo_initialize ... tombolo_finalize".into()));
        };
        let _alarm = under_way.alarm();
        // SAFETY: as the module says: the arrays live while this call runs.
        let channels: Result<Vec<_>, _> = run.channels.iter().map(|named| unsafe { named.channel() }).collect();
        let given = channels.map(|channels| (Step { cycle, time, time_step }, channels));
        under_way.execute(given)?;
        Ok(())
    })
}

fn motion<'a>(run: *const Handle) -> Option<&'a Motion> {
    // SAFETY: as the module says.
    unsafe { shared(run) }?.under_way()?.asked().motion.as_ref()
}

fn first(run: *const Handle, part: impl Fn(&Motion) -> &Vec<Vector>) -> *const f64 {
    motion(run).map_or(ptr::null(), |motion| part(motion).as_ptr().cast())
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_coordinates(run: *const Handle) -> *const f64 {
    first(run, |motion| &motion.coordinates)
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_displacement(run: *const Handle) -> *const f64 {
    first(run, |motion| &motion.displacement)
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_velocity(run: *const Handle) -> *const f64 {
    first(run, |motion| &motion.velocity)
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_schedule(
    run: *const Handle,
    shape: *mut c_uint,
    shapes: *mut c_uint,
    order: *mut c_char,
    bytes: usize,
) -> c_int {
    answer(|| {
        let (numbers, name) = motion(run).map_or(((0, 0), ""), |motion| (motion.shape, motion.order.as_str()));
        // SAFETY: as the module says.
        unsafe {
            if let Some(shape) = shape.as_mut() {
                *shape = numbers.0;
            }
            if let Some(shapes) = shapes.as_mut() {
                *shapes = numbers.1;
            }
            give(name, order, bytes);
        }
        Ok(())
    })
}

fn reading<'a>(run: *const Handle) -> Result<&'a Run, Fault> {
    // SAFETY: as the module says.
    let run = unsafe { shared(run) }.ok_or_else(|| Fault::Call("the run is a null pointer".into()))?;
    run.under_way().ok_or_else(|| Fault::Call("called outside of tombolo_initialize ... tombolo_finalize".into()))
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_parameter_value(run: *const Handle, name: *const c_char, value: *mut f64) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let name = unsafe { text(name, "name") }?;
        let known = &reading(run)?.asked().parameters;
        let found = known.get(&name).ok_or_else(|| {
            let names: Vec<&str> = known.keys().map(String::as_str).collect();
            Fault::invalid("parameter", format!("'{name}'"), format!("one of: {}", names.join(", ")))
        })?;
        // SAFETY: as the module says.
        match unsafe { value.as_mut() } {
            Some(value) => *value = *found,
            None => return Err(Fault::Call("value is a null pointer".into())),
        }
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_stopped(run: *const Handle) -> c_int {
    // SAFETY: as the module says.
    let run = unsafe { shared(run) };
    c_int::from(run.and_then(Handle::under_way).is_some_and(|run| run.asked().stop))
}

fn orders(run: *const Handle) -> Vec<OrderReport> {
    // SAFETY: as the module says.
    let Some(run) = (unsafe { shared(run) }) else { return Vec::new() };
    match run.under_way() {
        Some(under_way) => under_way.orders(),
        None => run.ended.as_ref().map(|report| report.orders.clone()).unwrap_or_default(),
    }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_order_count(run: *const Handle) -> usize {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| orders(run).len())).unwrap_or(0)
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_order(run: *const Handle, index: usize, json: *mut c_char, bytes: usize) -> c_int {
    answer(|| {
        let orders = orders(run);
        let order = orders
            .get(index)
            .ok_or_else(|| Fault::invalid("order", index, format!("a number below {}", orders.len())))?;
        let text = serde_json::to_string(order).unwrap_or_default();
        // SAFETY: as the module says.
        unsafe { give(&text, json, bytes) };
        Ok(())
    })
}
