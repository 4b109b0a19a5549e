//! Texts for viewers, which are written out when the first of them is sent one.

use std::sync::{Arc, LazyLock};

use axum::extract::ws::Utf8Bytes;
use serde_json::Value;

/// A text for any number of viewers. It is written out on the stream's thread, once, so that it
/// costs the solver no more than what it is made of.
#[derive(Clone)]
pub(crate) struct Text(Arc<LazyLock<Utf8Bytes, Box<dyn FnOnce() -> Utf8Bytes + Send>>>);

impl Text {
    /// The text of the message that `message` makes.
    pub(super) fn of(message: impl FnOnce() -> Value + Send + 'static) -> Self {
        Self(Arc::new(LazyLock::new(Box::new(move || message().to_string().into()))))
    }

    /// The text as it is sent.
    pub(crate) fn written(&self) -> Utf8Bytes {
        Utf8Bytes::clone(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use serde_json::json;

    use super::*;

    #[test]
    fn a_text_is_made_once_by_whoever_sends_it_first() {
        let made = Arc::new(AtomicU32::new(0));
        let count = Arc::clone(&made);
        let text = Text::of(move || json!({"made": count.fetch_add(1, Ordering::Relaxed) + 1}));
        let other = text.clone();
        assert_eq!(made.load(Ordering::Relaxed), 0);
        assert_eq!(text.written(), r#"{"made":1}"#);
        assert_eq!(other.written(), text.written());
    }
}
