//! Trees from and to text and files.

use std::ffi::{c_char, c_void};
use std::io::Write;
use std::ptr;

use super::{exported, hand_out, node, node_mut, run, string};
use crate::error::{Error, Result};
use crate::files;
use crate::node::Node;
use crate::print::{Detail, Style};
use crate::schema::{self, Protocol};

/// A text that may be absent.
///
/// # Safety
/// As the functions of [`super`].
unsafe fn optional(text: *const c_char) -> Result<String> {
    // SAFETY: as the caller promises.
    if text.is_null() { Ok(String::new()) } else { unsafe { string(text, "the text") } }
}

/// Fills a node with what a text or a file holds. The tree is made before the node is borrowed.
///
/// # Safety
/// As the functions of [`super`].
unsafe fn fill(target: *mut Node, made: impl FnOnce() -> Result<Node>) {
    run((), || {
        let made = made()?;
        // SAFETY: as the caller promises.
        unsafe { node_mut(target)?.take(made) }
    });
}

/// A tree over data that a schema describes.
///
/// # Safety
/// As the functions of [`super`]; the data are what the schema describes, for as long as the tree refers to them.
unsafe fn laid_over(
    schema: *const c_char,
    protocol: *const c_char,
    data: *mut c_void,
) -> Result<Node> {
    // SAFETY: as the caller promises.
    unsafe {
        schema::over(
            &string(schema, "the schema")?,
            Protocol::from_name(&optional(protocol)?)?,
            data.cast(),
        )
    }
}

exported! {
    "catalyst_conduit_node_parse" => parse(target: *mut Node, text: *const c_char, protocol: *const c_char) {
        fill(target, || schema::parse(&string(text, "the text")?, Protocol::from_name(&optional(protocol)?)?))
    }
    "catalyst_conduit_node_generate" =>
        generate(target: *mut Node, schema: *const c_char, protocol: *const c_char, data: *mut c_void) {
            fill(target, || laid_over(schema, protocol, data)?.copy())
        }
    "catalyst_conduit_node_generate_external" =>
        generate_external(target: *mut Node, schema: *const c_char, protocol: *const c_char, data: *mut c_void) {
            fill(target, || laid_over(schema, protocol, data))
        }
    "catalyst_conduit_node_load" => load(target: *mut Node, path: *const c_char, protocol: *const c_char) {
        fill(target, || files::load(&string(path, "the path")?, &optional(protocol)?))
    }
    "catalyst_conduit_node_save" => save(source: *mut Node, path: *const c_char, protocol: *const c_char) {
        run((), || files::save(node(source)?, &string(path, "the path")?, &optional(protocol)?))
    }
}

/// The options of a call over a style.
fn styled(options: Option<&Node>, mut style: Style, protocol: &str) -> Result<(Style, String)> {
    let Some(options) = options else {
        return Ok((style, protocol.to_owned()));
    };
    let count = |name: &str, otherwise: usize| match options.get(name) {
        None => Ok(otherwise),
        Some(node) => match node.integer().and_then(|value| usize::try_from(value).ok()) {
            Some(value) => Ok(value),
            None => {
                Err(Error::new(format!("the option '{name}' is a number that is not negative")))
            }
        },
    };
    // Summaries leave nothing out where a threshold is 0 or negative.
    let threshold = |name: &str, otherwise: usize| match options.get(name).and_then(Node::integer) {
        Some(value) if value <= 0 => Ok(usize::MAX),
        _ => count(name, otherwise),
    };
    let text = |name: &str, otherwise: &str| match options.get(name) {
        None => Ok(otherwise.to_owned()),
        Some(node) => {
            node.text().ok_or_else(|| Error::new(format!("the option '{name}' is a text")))
        }
    };
    style.indent = count("indent", style.indent)?.min(1 << 10);
    style.depth = count("depth", style.depth)?.min(1 << 10);
    style.pad = text("pad", &style.pad)?;
    style.end = text("eoe", &style.end)?;
    style.children = threshold("num_children_threshold", style.children)?;
    style.elements = threshold("num_elements_threshold", style.elements)?;
    Ok((style, text("protocol", protocol)?))
}

fn write(source: &Node, style: &Style, protocol: &str) -> Result<String> {
    Ok(match protocol {
        "yaml" => source.to_yaml(style),
        "json" => source.to_json(style, Detail::Values),
        _ => match Protocol::from_name(protocol)? {
            Protocol::Base64 => schema::to_base64_json(source)?,
            _ => source.to_json(style, Detail::Everything),
        },
    })
}

macro_rules! writers {
    ($($name:literal: $protocol:literal, $style:expr;)*) => { $(
        const _: () = {
            #[unsafe(export_name = concat!("catalyst_conduit_node_", $name))]
            unsafe extern "C-unwind" fn plain(source: *const Node) -> *mut c_char {
                // SAFETY: the caller keeps to `c_api`'s rules.
                run(ptr::null_mut(), || Ok(hand_out(&write(unsafe { node(source)? }, &$style, $protocol)?)))
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_", $name, "_with_options"))]
            unsafe extern "C-unwind" fn with_options(source: *const Node, options: *const Node) -> *mut c_char {
                run(ptr::null_mut(), || {
                    // SAFETY: the caller keeps to `c_api`'s rules.
                    let (source, options) = unsafe { (node(source)?, options.as_ref()) };
                    let (style, protocol) = styled(options, $style, $protocol)?;
                    Ok(hand_out(&write(source, &style, &protocol)?))
                })
            }
        };
    )* };
}
writers! {
    "to_json": "json", Style::default();
    "to_yaml": "yaml", Style::default();
    "to_string": "yaml", Style::default();
    "to_summary_string": "yaml", Style::summary();
}

/// Text goes where `printf` of the C library goes, in the same order.
fn show(text: &str) {
    // SAFETY: a null stream flushes all that the C library holds back.
    unsafe { libc::fflush(ptr::null_mut()) };
    let mut output = std::io::stdout().lock();
    // A closed standard output is no reason to stop a solver.
    let _ = output.write_all(text.as_bytes()).and_then(|()| output.flush());
}

exported! {
    "catalyst_conduit_node_print" => print(source: *mut Node) {
        run((), || {
            show(&format!("{}\n", node(source)?.to_yaml(&Style::summary())));
            Ok(())
        })
    }
    "catalyst_conduit_node_print_detailed" => print_detailed(source: *mut Node) {
        run((), || {
            show(&format!("{}\n", node(source)?.to_json(&Style::default(), Detail::Everything)));
            Ok(())
        })
    }
}
