//! Where messages go that belong to no call.

use std::ffi::{c_char, c_int, c_void};

use tombolo::logging::{self, Level, LevelFilter};

use crate::export::export;
use crate::{Fault, c_string};

/// A function of the caller that takes messages; it can be called until another takes its place.
type Function = unsafe extern "C" fn(c_int, *const c_char, *mut c_void);

/// The caller's own pointer, handed back with each message.
struct UserData(*mut c_void);

// SAFETY: it is handed to the caller's function and not followed; the header says that any thread
// may call that.
unsafe impl Send for UserData {}

impl UserData {
    fn get(&self) -> *mut c_void {
        self.0
    }
}

fn number(level: Level) -> c_int {
    match level {
        Level::ERROR => 1,
        Level::WARN => 2,
        Level::INFO => 3,
        _ => 4,
    }
}

export! {
    fn tombolo_log(level: c_int, function: Option<Function>, user_data: *mut c_void) {
        let most = match level {
            0 => LevelFilter::OFF,
            1 => LevelFilter::ERROR,
            2 => LevelFilter::WARN,
            3 => LevelFilter::INFO,
            4 => LevelFilter::DEBUG,
            other => return Err(Fault::invalid("log", format!("the level {other}"), "one of enum tombolo_level")),
        };
        let sink = function.map(|function| -> logging::Sink {
            let user_data = UserData(user_data);
            Box::new(move |level, message| {
                let message = c_string(message);
                // SAFETY: the caller's function, which is there until it is replaced; the text ends
                // in a nul.
                unsafe { function(number(level), message.as_ptr(), user_data.get()) };
            })
        });
        logging::send_to(most, sink).map_err(|error| Fault::Call(error.to_string()))
    }
}
