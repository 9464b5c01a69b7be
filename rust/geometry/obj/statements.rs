//! Statements of an OBJ file, prepared for tobj.
//!
//! tobj reads `v` and `f`, and loses or refuses much of what surrounds them. The rest of a file is dealt with here:
//!
//! - lines joined by a backslash; comments after a statement;
//! - names: tobj gives each run of faces one name, of the last `o` or `g`, and only materials of an `.mtl`;
//! - `l`, whose polylines tobj takes for faces, and `vt` and `vn`, whose faults would refuse a mesh that needs neither;
//! - numbers after the coordinates: tobj divides by a fourth, and refuses colours of four or of some vertices only;
//! - the order of vertices: tobj numbers them by the faces that use them and drops the others.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Write;
use std::io::{BufRead, Read};

use crate::cancel::Cancel;

/// One statement of a file.
pub(super) struct Statement<'a> {
    /// Number of its first line, counted from 1.
    pub line: usize,
    text: Cow<'a, str>,
}

impl Statement<'_> {
    /// Keyword, and the rest of the line.
    pub fn split(&self) -> (&str, &str) {
        let text = self.text.trim();
        let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        (keyword, rest.trim_start())
    }
}

/// The rest of a line up to a comment. Names have none: they may hold blanks and `#`.
pub(super) fn values(rest: &str) -> &str {
    rest.split_once('#').map_or(rest, |(values, _)| values.trim_end())
}

/// Statements of a text: its lines, those joined that end in a backslash.
pub(super) fn statements(text: &str) -> impl Iterator<Item = Statement<'_>> {
    // A comment may end in a backslash by accident, as in a path: it ends with its line.
    let continued = |line: &str| line.trim_end().ends_with('\\') && !line.contains('#');
    let mut lines = text.lines().zip(1..);
    std::iter::from_fn(move || {
        let (first, line) = lines.next()?;
        let mut text = Cow::Borrowed(first);
        let mut last = first;
        while continued(last) {
            let kept = text.trim_end().trim_end_matches('\\').len();
            text.to_mut().truncate(kept);
            let Some((next, _)) = lines.next() else { break };
            text.to_mut().extend([" ", next]);
            last = next;
        }
        Some(Statement { line, text })
    })
}

/// Reader of the vertices and faces of a text, one statement a line.
///
/// A last face names all vertices in file order: its corners say which number tobj has given to each of them.
pub(super) struct Reader<'c, S> {
    statements: S,
    /// Statement that is being read, and number of bytes already read.
    buffer: String,
    num_read: usize,
    /// Line of that statement in the file, counted from 1.
    pub line: usize,
    pub num_vertices: usize,
    pub objects: Names,
    pub groups: Names,
    pub materials: Names,
    is_closed: bool,
    cancel: &'c Cancel,
}

impl<'a, 'c, S: Iterator<Item = Statement<'a>>> Reader<'c, S> {
    pub fn new(statements: S, cancel: &'c Cancel) -> Self {
        Self {
            statements,
            buffer: String::new(),
            num_read: 0,
            line: 1,
            num_vertices: 0,
            objects: Names::default(),
            groups: Names::default(),
            materials: Names::default(),
            is_closed: false,
            cancel,
        }
    }

    /// Put the next vertex or face into the buffer, after the last one the face of all vertices, and then nothing.
    fn advance(&mut self) {
        self.buffer.clear();
        self.num_read = 0;
        for statement in self.statements.by_ref() {
            let (keyword, rest) = statement.split();
            match keyword {
                "v" => {
                    self.num_vertices += 1;
                    self.buffer.push('v');
                    for word in values(rest).split_whitespace().take(3) {
                        self.buffer.extend([" ", word]);
                    }
                }
                "f" => {
                    for names in [&mut self.objects, &mut self.groups, &mut self.materials] {
                        names.add_face();
                    }
                    self.buffer.extend(["f ", values(rest)]);
                }
                "o" => self.objects.select(rest),
                "g" => self.groups.select(rest),
                "usemtl" => self.materials.select(rest),
                _ => {}
            }
            if !self.buffer.is_empty() {
                self.line = statement.line;
                self.buffer.push('\n');
                return;
            }
        }
        if !std::mem::replace(&mut self.is_closed, true) {
            self.buffer.push('f');
            for number in 1..=self.num_vertices {
                let _ = write!(self.buffer, " {number}"); // a String takes all
            }
        }
    }
}

impl<'a, S: Iterator<Item = Statement<'a>>> Read for Reader<'_, S> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let num_read = self.fill_buf()?.read(bytes)?;
        self.consume(num_read);
        Ok(num_read)
    }
}

impl<'a, S: Iterator<Item = Statement<'a>>> BufRead for Reader<'_, S> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        // An error, so that tobj does not go on with half of the file.
        self.cancel.check().map_err(std::io::Error::other)?;
        if self.num_read == self.buffer.len() {
            self.advance();
        }
        Ok(&self.buffer.as_bytes()[self.num_read..])
    }

    fn consume(&mut self, num_bytes: usize) {
        self.num_read += num_bytes;
    }
}

/// Names of one kind, and the name of every face.
#[derive(Default)]
pub(super) struct Names {
    /// Names in the order in which faces first use them.
    pub list: Vec<String>,
    /// Index into `list` for each face.
    pub of_face: Vec<u32>,
    known: HashMap<String, u32>,
    selected: String,
    /// Index of `selected` once a face uses it.
    index: Option<u32>,
}

impl Names {
    fn select(&mut self, name: &str) {
        name.clone_into(&mut self.selected);
        self.index = None;
    }

    fn add_face(&mut self) {
        let index = *self.index.get_or_insert_with(|| {
            *self.known.entry(self.selected.clone()).or_insert_with(|| {
                self.list.push(self.selected.clone());
                (self.list.len() - 1) as u32
            })
        });
        self.of_face.push(index);
    }
}
