//! Names in which % and two hexadecimal digits stand for a character.

use std::fmt::Write as _;

/// A name whose special characters stand as % and two hexadecimal digits, as VTK writes names into
/// legacy files.
pub(super) fn decoded(name: &str) -> String {
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name.as_bytes();
    while let Some((&byte, tail)) = rest.split_first() {
        let code =
            tail.get(..2).filter(|_| byte == b'%').and_then(|code| std::str::from_utf8(code).ok());
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(code) => {
                bytes.push(code);
                rest = tail.get(2..).unwrap_or(&[]);
            }
            None => {
                bytes.push(byte);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// A name for an array of XML: what has a meaning there is encoded, because VTK itself writes names
/// as they are.
pub(super) fn encoded(name: &str) -> String {
    name.chars().fold(String::new(), |mut text, letter| {
        if letter.is_ascii_control() || "\"%&<>".contains(letter) {
            let _ = write!(text, "%{:02X}", u32::from(letter));
        } else {
            text.push(letter);
        }
        text
    })
}

/// A name for an array of a legacy file, as VTK encodes it: one word of printable characters.
#[cfg(feature = "vtkio")]
pub(super) fn encoded_for_legacy(name: &str) -> String {
    name.bytes().fold(String::new(), |mut text, byte| {
        if byte.is_ascii_graphic() && !b"\"%".contains(&byte) {
            text.push(char::from(byte));
        } else {
            let _ = write!(text, "%{byte:02X}");
        }
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_encoded_and_decoded() {
        for name in ["inlet", "side & \"end\" <of> Straße", "100 %41", "two\nlines\0", "%", ""] {
            let text = encoded(name);
            assert_eq!(decoded(&text), name);
            assert!(!text.contains(['"', '&', '<', '>', '\n', '\0']), "{text}");
        }
        assert_eq!(decoded("string%20let"), "string let");
        assert_eq!(decoded("50%"), "50%");
    }
}
