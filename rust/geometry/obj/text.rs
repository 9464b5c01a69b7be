//! Text of an OBJ file: encodings, byte-order marks and line ends.

use std::borrow::Cow;

use super::fault::Fault;

/// Text of a file, with `\n` as the only line end and without byte-order marks; or the fault of its first NUL.
pub(super) fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, Fault> {
    let mut text = match bytes {
        [0xff, 0xfe, rest @ ..] => Cow::Owned(decode_utf16(rest, u16::from_le_bytes)),
        [0xfe, 0xff, rest @ ..] => Cow::Owned(decode_utf16(rest, u16::from_be_bytes)),
        _ => String::from_utf8_lossy(bytes),
    };
    // Files put together have marks in their midst.
    if text.contains('\u{feff}') {
        text = Cow::Owned(text.replace('\u{feff}', ""));
    }
    if text.contains('\r') {
        text = Cow::Owned(text.replace("\r\n", "\n").replace('\r', "\n"));
    }
    match text.split_once('\0') {
        None => Ok(text),
        Some((before, _)) => Err(Fault {
            line: before.matches('\n').count() + 1,
            message: "text: expected UTF-8, or UTF-16 with a byte-order mark, got a NUL character".to_owned(),
        }),
    }
}

fn decode_utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.as_chunks().0.iter().map(|&pair| unit(pair));
    char::decode_utf16(units)
        .map(|result| result.unwrap_or(char::REPLACEMENT_CHARACTER))
        .collect()
}
