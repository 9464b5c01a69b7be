//! Text: encodings, line ends, comments, continued lines, statements that are not read.

use super::*;

#[test]
fn crlf_counts_as_one_line() {
    assert_eq!(fault("v 0 0 0\r\n\r\nf 1\r\n").0, 3);
}

#[test]
fn file_without_faces_is_refused() {
    let expected = "file: expected faces that have an area, got none";
    for text in [
        "",
        "\n",
        "\r\n",
        " ",
        "# nothing",
        "\\",
        "\u{feff}",
        "v 1 2 3",
        "o a",
        "l 1 2",
        "g\r\r",
    ] {
        assert_eq!(fault(text).1, expected);
    }
    assert_eq!(fault(CORNERS), (8, expected.to_owned()));
}

#[test]
fn utf16_and_byte_order_marks_are_decoded() {
    let text = "o W\u{fc}rfel \u{1f4e6}\r\n".to_owned() + &cube().replace('\n', "\r\n");
    let units = || std::iter::once(0xfeff).chain(text.encode_utf16());
    let little: Vec<u8> = units().flat_map(u16::to_le_bytes).collect();
    let big: Vec<u8> = units().flat_map(u16::to_be_bytes).collect();
    for bytes in [
        text.clone().into_bytes(),
        format!("\u{feff}{text}").into_bytes(),
        little,
        big,
    ] {
        let obj = parse(&bytes).unwrap();
        assert_unit_cube(&obj);
        assert_eq!(obj.object_names, ["W\u{fc}rfel \u{1f4e6}"]);
    }
}

#[test]
fn marks_between_files_put_together_are_skipped() {
    let obj = read("\u{feff}v 0 0 0\nv 1 0 0\n\u{feff}# second\n\u{feff}v 0 1 0\n\u{feff}f 1 2 3\n");
    assert_eq!((obj.vertices.len(), obj.triangles.len()), (3, 1));
}

#[test]
fn file_with_nul_is_refused_with_its_line() {
    let utf16: Vec<u8> = cube().encode_utf16().flat_map(u16::to_le_bytes).collect();
    let utf32: Vec<u8> = format!("\u{feff}{}", cube())
        .chars()
        .flat_map(|c| u32::from(c).to_le_bytes())
        .collect();
    let object_file = b"\x64\x86\x03\x00\xd6\x2e\x00\x00.text\x00\x00\x00"; // of a compiler, which are .obj too
    let gzip = b"\x1f\x8b\x08\x00\x00\x00\x00\x00";
    let expected = "text: expected UTF-8, or UTF-16 with a byte-order mark, got a NUL character";
    for bytes in [&utf16, &utf32, &object_file[..], gzip] {
        assert_eq!(parse(bytes).unwrap_err().to_string(), format!("part.obj:1: {expected}"));
    }
    // A file whose end was never written.
    assert_eq!(fault(&(cube() + "f 1 2\0\0\0\0")), (15, expected.to_owned()));
}

#[test]
fn message_is_one_line_of_printable_characters() {
    assert_eq!(
        fault("v 0 0 \u{1b}[2J\u{7}\u{202e}").1,
        "vertex: expected three numbers, got `0 0 \\u{1b}[2J\\u{7}\\u{202e}`"
    );
}

#[test]
fn lines_of_a_million_characters_are_read() {
    let long = |text: &str| text.repeat(1_000_000 / text.len());
    let faces = sides(|vertex| vertex.to_string());
    for text in [
        format!("# {}\n", long("f 1 2 999 ")),
        format!("# {}\n", long("\\ ")),
        format!("g {}\n", long("name")),
        format!("mtllib {}\n", long("a.mtl ")),
        format!("l{}\n", long(" 1 2")),
        format!("v 0 0 0.{}\n", long("0")),
        long("\\\n") + "\n",
        long(" "),
    ] {
        assert_eq!(read(&(CORNERS.to_owned() + &text + &faces)).triangles.len(), 12);
    }
    let obj = read(&format!("{CORNERS}f 1{} 4 3\n", long(" \\\n 2")));
    assert_eq!((obj.triangles.len(), area(&obj)), (2, 1.0));
}

#[test]
fn latin1_in_comments_and_names_does_no_harm() {
    let bytes = [b"# caf\xe9\ng caf\xe9\n", cube().as_bytes()].concat();
    let obj = parse(&bytes).unwrap();
    assert_unit_cube(&obj);
    assert_eq!(obj.group_names, ["caf\u{fffd}"]);
}

#[test]
fn backslash_joins_lines_and_keeps_their_numbers() {
    assert_unit_cube(&read(&cube().replace(' ', " \\\n").replace("4 \\", "4 \\ \r")));
    // The fault of a joined statement is at its first line, and the lines after it keep their numbers.
    assert_eq!(fault("v 0 0 0\nf 1 \\\n 1 \\\n 2\n").0, 2);
    assert_eq!(fault("v 0 0 \\\n 0\nf 1 1\n").0, 3);
}

#[test]
fn comment_that_ends_in_a_backslash_hides_nothing() {
    assert_unit_cube(&read(&("# exported to C:\\parts\\\n".to_owned() + &cube())));
    assert_unit_cube(&read(&cube().replace('\n', " # see C:\\parts\\\n")));
}

#[test]
fn points_lines_and_unknown_words_are_ignored() {
    // tobj takes lines of three points and more for faces.
    let noise =
        "p 1 2\nl 1 2 3\nl 1 2 3 4\nl 1\nl 9\ns off\nvp 0 0\ncstype bezier\ncurv 0 1 1 2\nend\nfoo bar\nvertex 1\n";
    assert_unit_cube(&read(&(noise.to_owned() + &cube() + noise)));
}
