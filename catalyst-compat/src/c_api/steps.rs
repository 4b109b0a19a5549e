//! `tombolo_execute` and what it gives back.

use std::ffi::{c_char, c_int, c_uint};
use std::ptr;

use tombolo::deform::mesh::Vector;
use tombolo::pipelines::language::nearest;
use tombolo::{ExecuteError, OrderReport, Step};

use super::{Fault, Handle, Opened, Stage, answer, c_string, text, value, with};
use crate::motion::Motion;

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_execute(
    run: *mut Handle,
    cycle: u64,
    time: f64,
    time_step: f64,
) -> c_int {
    answer(|| {
        with(run, |run| {
            run.begin()?;
            run.orders.clear();
            let Stage::UnderWay(under_way) = &mut run.stage else {
                return Err(Opened::after_the_end());
            };
            let _alarm = under_way.alarm();
            // SAFETY: as the module says: the arrays live while this call runs.
            let channels: Result<Vec<_>, _> =
                run.channels.iter().map(|named| unsafe { named.channel() }).collect();
            let given = channels.map(|channels| (Step { cycle, time, time_step }, channels));
            if !under_way.execute(given)? {
                return Err(ExecuteError::NoChannel { cycle }.into());
            }
            run.channels.iter_mut().for_each(|named| named.is_shown = true);
            let order = under_way.asked().motion.as_ref().map(|motion| motion.order.as_str());
            if let Some(order) =
                order.filter(|order| run.motion_order.to_bytes() != order.as_bytes())
            {
                run.motion_order = c_string(order);
            }
            Ok(())
        })
    })
}

/// Something of the motion that is asked for; `None` where the mesh stays.
fn motion<T>(run: *mut Handle, part: impl FnOnce(&Motion, &Opened) -> T) -> Option<T> {
    value(None, || {
        with(run, |run| {
            Ok(run.under_way()?.asked().motion.as_ref().map(|motion| part(motion, run)))
        })
    })
}

fn first(vectors: &[Vector]) -> *const f64 {
    vectors.as_ptr().cast()
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_coordinates(run: *mut Handle) -> *const f64 {
    value(ptr::null(), || {
        Ok(motion(run, |motion, _| first(&motion.coordinates)).unwrap_or(ptr::null()))
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_displacement(run: *mut Handle) -> *const f64 {
    value(ptr::null(), || {
        Ok(motion(run, |motion, _| first(&motion.displacement)).unwrap_or(ptr::null()))
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_velocity(run: *mut Handle) -> *const f64 {
    value(ptr::null(), || {
        Ok(motion(run, |motion, _| first(&motion.velocity)).unwrap_or(ptr::null()))
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_motion_count(run: *mut Handle) -> usize {
    value(0, || Ok(motion(run, |motion, _| motion.coordinates.len()).unwrap_or(0)))
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_surface_coordinates(run: *mut Handle) -> *const f64 {
    value(ptr::null(), || {
        Ok(motion(run, |motion, _| first(&motion.surface.coordinates)).unwrap_or(ptr::null()))
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_surface_displacement(run: *mut Handle) -> *const f64 {
    value(ptr::null(), || {
        Ok(motion(run, |motion, _| first(&motion.surface.displacement)).unwrap_or(ptr::null()))
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_surface_velocity(run: *mut Handle) -> *const f64 {
    value(ptr::null(), || {
        Ok(motion(run, |motion, _| first(&motion.surface.velocity)).unwrap_or(ptr::null()))
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_surface_vertices(run: *mut Handle) -> *const u32 {
    value(ptr::null(), || {
        Ok(motion(run, |motion, _| motion.surface.vertices.as_ptr()).unwrap_or(ptr::null()))
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_surface_count(run: *mut Handle) -> usize {
    value(0, || Ok(motion(run, |motion, _| motion.surface.vertices.len()).unwrap_or(0)))
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_motion_order(run: *mut Handle) -> *const c_char {
    value(
        ptr::null(),
        || Ok(motion(run, |_, run| run.motion_order.as_ptr()).unwrap_or(ptr::null())),
    )
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_motion_shape(
    run: *mut Handle,
    shape: *mut c_uint,
    shapes: *mut c_uint,
) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let (shape, shapes) = unsafe { (shape.as_mut(), shapes.as_mut()) };
        let (shape, shapes) = shape.zip(shapes).ok_or_else(|| Fault::null("shape or shapes"))?;
        (*shape, *shapes) = (0, 0);
        let asked = with(run, |run| {
            Ok(run.under_way()?.asked().motion.as_ref().map(|motion| motion.shape))
        })?;
        (*shape, *shapes) = asked.unwrap_or_default();
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_parameter_value(
    run: *mut Handle,
    name: *const c_char,
    value: *mut f64,
) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let (name, value) = unsafe { (text(name, "the parameter's name")?, value.as_mut()) };
        let value = value.ok_or_else(|| Fault::null("value"))?;
        with(run, |run| {
            let known = &run.under_way()?.asked().parameters;
            *value = *known.get(&name).ok_or_else(|| {
                let names = known.keys().map(String::as_str);
                let expected = match nearest(&name, names.clone()) {
                    Some(near) => {
                        format!("one that tombolo_parameter declared; did you mean '{near}'?")
                    }
                    None if known.is_empty() => {
                        "one that tombolo_parameter declared; none was".into()
                    }
                    None => format!("one of: {}", names.collect::<Vec<_>>().join(", ")),
                };
                Fault::invalid("parameter", format!("'{name}'"), expected)
            })?;
            Ok(())
        })
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_stopped(run: *mut Handle) -> c_int {
    // A solver whose run is not there any more is not to go on for ever.
    value(1, || {
        with(run, |run| match &run.stage {
            Stage::Opened(_) => Ok(0),
            Stage::UnderWay(under_way) => Ok(c_int::from(under_way.asked().stop)),
            Stage::Ended => Ok(1),
        })
    })
}

fn orders(run: &Opened) -> Vec<OrderReport> {
    match (&run.stage, &run.report) {
        (Stage::UnderWay(under_way), _) => under_way.orders(),
        (_, Some((report, _))) => report.orders.clone(),
        _ => Vec::new(),
    }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_order_count(run: *mut Handle) -> usize {
    value(0, || with(run, |run| Ok(orders(run).len())))
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_order(run: *mut Handle, index: usize) -> *const c_char {
    value(ptr::null(), || {
        with(run, |run| {
            let orders = orders(run);
            let order = orders.get(index).ok_or_else(|| {
                let expected = match orders.len() {
                    0 => "no index, as there are no orders".into(),
                    count => format!("an index from 0 to {}", count - 1),
                };
                Fault::invalid("order", index, expected)
            })?;
            let text = c_string(&serde_json::to_string(order).unwrap_or_default());
            // A caller may hold the address of the text that was given before: it is replaced only where the order went on.
            let kept = run.orders.entry(index).or_default();
            if *kept != text {
                *kept = text;
            }
            Ok(kept.as_ptr())
        })
    })
}
