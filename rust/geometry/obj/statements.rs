//! What the statements of an OBJ file of any dialect say.

use std::borrow::Cow;
use std::collections::HashMap;

/// Coordinates from this on are refused, whatever the unit of the file: no body is so large, and squares stay finite.
const LARGEST: f64 = 1e15;

/// What is wrong with a file, and the line where it is, counted from 1.
#[derive(Debug)]
pub(super) struct Fault {
    pub line: usize,
    pub message: String,
}

/// Vertices, faces and names, each in file order.
#[derive(Default)]
pub(super) struct Statements {
    pub vertices: Vec<[f64; 3]>,
    /// Indices into `vertices` of the corners of all faces, one face after another.
    pub corners: Vec<u32>,
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

/// Statements of a file, or its first fault.
pub(super) fn read(bytes: &[u8]) -> Result<Statements, Fault> {
    let text = decode(bytes)?;
    let mut read = Statements::default();
    let mut ahead = Ahead::default();
    for (line, statement) in statements(&text) {
        let statement = statement.trim();
        let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
        let outcome = match keyword {
            "v" => read.add_vertex(rest),
            "f" => read.add_face(line, rest, &mut ahead),
            _ => {
                read.select_name(keyword, rest.trim());
                Ok(())
            }
        };
        outcome.map_err(|message| Fault { line, message })?;
    }
    ahead.check(read.vertices.len())?;
    Ok(read)
}

/// Text of a file, with `\n` as the only line end and without byte-order marks.
fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, Fault> {
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

/// Lines with those joined that end in a backslash, each with the number of its first line.
fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    // A comment may end in a backslash by accident, as in a path: it ends with its line.
    let continued = |line: &str| line.trim_end().ends_with('\\') && !line.split_ascii_whitespace().any(is_comment);
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
    rest.split_ascii_whitespace().take_while(|word| !is_comment(word))
}

fn is_comment(word: &str) -> bool {
    word.starts_with('#')
}

/// A word for a message: characters that do not print are escaped, and it is cut where it is unreasonably long.
fn quoted(word: &str) -> String {
    const SHOWN: usize = 40;
    let shown: String = word.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    let dots = if word.chars().nth(SHOWN).is_some() { "..." } else { "" };
    format!("`{shown}{dots}`")
}

impl Statements {
    /// Reads `x y z`; a weight or colour after them is ignored.
    fn add_vertex(&mut self, rest: &str) -> Result<(), String> {
        let mut vertex = [0.0; 3];
        let mut num_coordinates = 0;
        for (coordinate, word) in vertex.iter_mut().zip(words(rest)) {
            let wrong = |expected: &str| format!("vertex: expected {expected}, got {}", quoted(word));
            *coordinate = match word.parse::<f64>() {
                Ok(number) if number.abs() < LARGEST => number,
                Ok(number) if number.is_finite() => {
                    return Err(wrong(&format!("a number between -{LARGEST:e} and {LARGEST:e}")));
                }
                Ok(_) => return Err(wrong("a finite number")),
                Err(_) => return Err(wrong("a number")),
            };
            num_coordinates += 1;
        }
        if num_coordinates < 3 {
            return Err(format!("vertex: expected 3 coordinates, got {num_coordinates}"));
        }
        self.vertices.push(vertex);
        Ok(())
    }

    /// Reads corners `v`, `v/vt`, `v//vn` or `v/vt/vn`, of which only `v` is used.
    fn add_face(&mut self, line: usize, rest: &str, ahead: &mut Ahead) -> Result<(), String> {
        let mut num_corners = 0;
        for word in words(rest) {
            let index = self.vertex_index(word)?;
            if index >= self.vertices.len() {
                ahead.note(line, index);
            }
            self.corners.push(index as u32); // those that do not fit are ahead of any vertex
            num_corners += 1;
        }
        if num_corners < 3 {
            return Err(format!("face: expected at least 3 corners, got {num_corners}"));
        }
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

    /// Index into `vertices` of the vertex that a corner names; it may lie beyond those read so far.
    fn vertex_index(&self, corner: &str) -> Result<usize, String> {
        let word = corner.split_once('/').map_or(corner, |(vertex, _)| vertex);
        let number: isize = word
            .parse()
            .map_err(|_| format!("face: expected a vertex index, got {}", quoted(corner)))?;
        let num_vertices = self.vertices.len();
        match number {
            0 => Err("face: expected a vertex index counted from 1, got 0".to_owned()),
            1.. => Ok(number.unsigned_abs() - 1),
            // -1 is the last vertex read so far.
            _ => num_vertices
                .checked_sub(number.unsigned_abs())
                .ok_or_else(|| format!("face: expected at most {num_vertices} vertices back, got {number}")),
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
        let missing = self.0.iter().find(|&&(_, index)| index >= num_vertices);
        missing.map_or(Ok(()), |&(line, index)| {
            let number = index + 1;
            let message = format!("face: expected a vertex index of at most {num_vertices}, got {number}");
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
