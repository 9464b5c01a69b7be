//! Rewrites an OBJ file of any dialect as plain `v x y z` and `f a b c ...` lines.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Write;

/// What is wrong with a file, and the line where it is, counted from 1.
#[derive(Debug)]
pub(super) struct Fault {
    pub line: usize,
    pub message: String,
}

/// A file in plain OBJ, and what plain OBJ does not say about its faces.
#[derive(Default)]
pub(super) struct Repaired {
    /// One line `v x y z` per vertex, numbers as the file has them and all finite.
    pub vertex_lines: String,
    /// One line `f a b c ...` per face, positive indices without texture and normal.
    pub face_lines: String,
    pub num_vertices: usize,
    pub faces: Vec<Face>,
    pub objects: Names,
    pub groups: Names,
    pub materials: Names,
}

/// One `f` statement.
pub(super) struct Face {
    pub line: usize,
    pub num_corners: usize,
    pub object: u32,
    pub group: u32,
    pub material: u32,
}

/// Plain OBJ of a file, or its first fault.
pub(super) fn repair(bytes: &[u8]) -> Result<Repaired, Fault> {
    let text = decode(bytes);
    let mut repaired = Repaired::default();
    let mut ahead = Ahead::default();
    for (line, statement) in statements(&text) {
        let statement = statement.trim();
        let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
        let outcome = match keyword {
            "v" => repaired.add_vertex(rest),
            "f" => repaired.add_face(line, rest, &mut ahead),
            _ => {
                repaired.select_name(keyword, rest.trim());
                Ok(())
            }
        };
        outcome.map_err(|message| Fault { line, message })?;
    }
    ahead.check(repaired.num_vertices)?;
    Ok(repaired)
}

/// Text of a file, with `\n` as the only line end.
fn decode(bytes: &[u8]) -> Cow<'_, str> {
    let text = match bytes {
        [0xff, 0xfe, rest @ ..] => Cow::Owned(decode_utf16(rest, u16::from_le_bytes)),
        [0xfe, 0xff, rest @ ..] => Cow::Owned(decode_utf16(rest, u16::from_be_bytes)),
        [0xef, 0xbb, 0xbf, rest @ ..] => String::from_utf8_lossy(rest),
        _ => String::from_utf8_lossy(bytes),
    };
    if text.contains('\r') {
        Cow::Owned(text.replace("\r\n", "\n").replace('\r', "\n"))
    } else {
        text
    }
}

fn decode_utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.as_chunks().0.iter().map(|&pair| unit(pair));
    char::decode_utf16(units)
        .map(|result| result.unwrap_or(char::REPLACEMENT_CHARACTER))
        .collect()
}

/// Lines with those joined that end in a backslash, each with the number of its first line.
fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    // A comment may end in a backslash by accident, as in a path.
    let continued = |line: &'_ str| line.trim_end().ends_with('\\') && !line.trim_start().starts_with('#');
    let mut lines = text.lines().zip(1..);
    std::iter::from_fn(move || {
        let (line, number) = lines.next()?;
        if !continued(line) {
            return Some((number, Cow::Borrowed(line)));
        }
        let mut joined = line.trim_end().trim_end_matches('\\').to_owned();
        for (line, _) in lines.by_ref() {
            joined.push(' ');
            joined.push_str(line.trim_end().trim_end_matches('\\'));
            if !continued(line) {
                break;
            }
        }
        Some((number, Cow::Owned(joined)))
    })
}

/// Blank-separated words of a statement up to a comment.
fn words(rest: &str) -> impl Iterator<Item = &str> {
    rest.split_ascii_whitespace().take_while(|word| !word.starts_with('#'))
}

/// A word for a message, cut where it is unreasonably long.
fn quoted(word: &str) -> String {
    const SHOWN: usize = 40;
    let mut shown: String = word.chars().take(SHOWN).collect();
    if shown.len() < word.len() {
        shown.push_str("...");
    }
    format!("`{shown}`")
}

impl Repaired {
    /// Reads `x y z`; a weight or colour after them is ignored.
    fn add_vertex(&mut self, rest: &str) -> Result<(), String> {
        self.vertex_lines.push('v');
        let mut num_coordinates = 0;
        for word in words(rest).take(3) {
            match word.parse::<f64>() {
                Ok(number) if number.is_finite() => {}
                Ok(_) => return Err(format!("vertex: expected a finite number, got {}", quoted(word))),
                Err(_) => return Err(format!("vertex: expected a number, got {}", quoted(word))),
            }
            self.vertex_lines.push(' ');
            self.vertex_lines.push_str(word);
            num_coordinates += 1;
        }
        if num_coordinates < 3 {
            return Err(format!("vertex: expected 3 coordinates, got {num_coordinates}"));
        }
        self.vertex_lines.push('\n');
        self.num_vertices += 1;
        Ok(())
    }

    /// Reads corners `v`, `v/vt`, `v//vn` or `v/vt/vn`, of which only `v` is used.
    fn add_face(&mut self, line: usize, rest: &str, ahead: &mut Ahead) -> Result<(), String> {
        self.face_lines.push('f');
        let mut num_corners = 0;
        for word in words(rest) {
            let index = self.vertex_index(word)?;
            if index > self.num_vertices {
                ahead.note(line, index);
            }
            let _ = write!(self.face_lines, " {index}"); // writing to a String cannot fail
            num_corners += 1;
        }
        if num_corners < 3 {
            return Err(format!("face: expected at least 3 corners, got {num_corners}"));
        }
        self.face_lines.push('\n');
        self.faces.push(Face {
            line,
            num_corners,
            object: self.objects.index(),
            group: self.groups.index(),
            material: self.materials.index(),
        });
        Ok(())
    }

    /// Reads the name of the faces that follow.
    fn select_name(&mut self, keyword: &str, name: &str) {
        match keyword {
            "o" => self.objects.select(name),
            "g" => self.groups.select(name),
            "usemtl" => self.materials.select(name),
            // Points, lines, curves, texture, normals, smoothing, material files, comments, unknown words.
            _ => {}
        }
    }

    /// Index, counted from 1, of the vertex that a corner names; it may lie beyond the vertices read so far.
    fn vertex_index(&self, corner: &str) -> Result<usize, String> {
        let word = corner.split_once('/').map_or(corner, |(vertex, _)| vertex);
        let index: isize = word
            .parse()
            .map_err(|_| format!("face: expected a vertex index, got {}", quoted(corner)))?;
        match index {
            0 => Err("face: expected a vertex index counted from 1, got 0".to_owned()),
            1.. => Ok(index.unsigned_abs()),
            // -1 is the last vertex read so far.
            _ => (self.num_vertices + 1)
                .checked_sub(index.unsigned_abs())
                .filter(|&index| index > 0)
                .ok_or_else(|| {
                    format!(
                        "face: expected at most {} vertices back, got {index}",
                        self.num_vertices
                    )
                }),
        }
    }
}

/// Indices of vertices that had not been read when a face named them. Only those larger than all before are kept:
/// the first to lie beyond the end of the file is among them.
#[derive(Default)]
struct Ahead(Vec<(usize, usize)>);

impl Ahead {
    fn note(&mut self, line: usize, index: usize) {
        if self.0.last().is_none_or(|&(_, largest)| index > largest) {
            self.0.push((line, index));
        }
    }

    fn check(&self, num_vertices: usize) -> Result<(), Fault> {
        let missing = self.0.iter().find(|&&(_, index)| index > num_vertices);
        missing.map_or(Ok(()), |&(line, index)| {
            let message = format!("face: expected a vertex index of at most {num_vertices}, got {index}");
            Err(Fault { line, message })
        })
    }
}

/// Names in the order in which faces first use them.
#[derive(Default)]
pub(super) struct Names {
    pub list: Vec<String>,
    known: HashMap<String, u32>,
    selected: String,
    /// Index of `selected` once a face uses it.
    selected_index: Option<u32>,
}

impl Names {
    fn select(&mut self, name: &str) {
        name.clone_into(&mut self.selected);
        self.selected_index = None;
    }

    /// Index of the selected name.
    fn index(&mut self) -> u32 {
        *self.selected_index.get_or_insert_with(|| {
            *self.known.entry(self.selected.clone()).or_insert_with(|| {
                self.list.push(self.selected.clone());
                (self.list.len() - 1) as u32
            })
        })
    }
}
