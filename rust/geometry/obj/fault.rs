//! Faults of an OBJ file, with the line, which tobj does not report.
//!
//! The statements are read again to find the line, only for files with a fault.

use tobj::LoadError;

use super::statements::{Statement, statements, values};

/// Fault of a file: description, and line counted from 1.
#[derive(Debug)]
pub(super) struct Fault {
    pub line: usize,
    pub message: String,
}

/// Fault of vertex `number` of the file, counted from 0.
pub(super) fn in_vertex(text: &str, number: usize, expected: &str) -> Fault {
    of_statement(nth(text, "v", number).as_ref(), "vertex", expected)
}

/// Fault of face `number` of the file, counted from 0.
pub(super) fn in_face(text: &str, number: usize, expected: &str) -> Fault {
    of_statement(nth(text, "f", number).as_ref(), "face", expected)
}

/// Fault of a file that ends without something.
pub(super) fn at_end(text: &str, expected: &str) -> Fault {
    Fault {
        line: text.lines().count().max(1),
        message: format!("file: expected {expected}, got none"),
    }
}

/// Fault that tobj met in the statement of a line, or once it had read them all.
pub(super) fn of_tobj(error: LoadError, text: &str, line: usize) -> Fault {
    let (kind, expected) = match error {
        LoadError::PositionParseError => ("vertex", "three numbers"),
        LoadError::FaceParseError => ("face", "vertex indices"),
        LoadError::FaceVertexOutOfBounds => return missing_vertex(text),
        _ => {
            let message = format!("text: expected OBJ, got {error}");
            return Fault { line, message };
        }
    };
    let statement = statements(text).find(|statement| statement.line == line);
    of_statement(statement.as_ref(), kind, expected)
}

/// Fault of the first corner whose vertex is not in the file.
fn missing_vertex(text: &str) -> Fault {
    let num_vertices = statements(text).filter(|statement| statement.split().0 == "v").count();
    let mut num_read = 0;
    for statement in statements(text) {
        let (keyword, rest) = statement.split();
        match keyword {
            "v" => num_read += 1,
            "f" => {
                let mut corners = values(rest).split_whitespace();
                if let Some(message) = corners.find_map(|corner| missing(corner, num_read, num_vertices)) {
                    let line = statement.line;
                    return Fault { line, message };
                }
            }
            _ => {}
        }
    }
    at_end(text, "vertex indices of the file")
}

/// Description of a fault in the vertex index of a corner, if there is one.
fn missing(corner: &str, num_read: usize, num_vertices: usize) -> Option<String> {
    let word = corner.split('/').next().unwrap_or_default();
    let index: isize = word.parse().unwrap_or(0);
    let expected = match index {
        0 => "a vertex index counted from 1".to_owned(),
        1.. if index.unsigned_abs() > num_vertices => format!("a vertex index of at most {num_vertices}"),
        ..0 if index.unsigned_abs() > num_read => format!("at most {num_read} vertices back"),
        _ => return None,
    };
    Some(format!("face: expected {expected}, got {}", quoted(word)))
}

fn nth<'a>(text: &'a str, keyword: &str, number: usize) -> Option<Statement<'a>> {
    statements(text)
        .filter(|statement| statement.split().0 == keyword)
        .nth(number)
}

/// Fault of a statement; of the first line if tobj and `statements` should count in different ways.
fn of_statement(statement: Option<&Statement>, kind: &str, expected: &str) -> Fault {
    let (line, got) = statement.map_or((1, ""), |statement| (statement.line, values(statement.split().1)));
    Fault {
        line,
        message: format!("{kind}: expected {expected}, got {}", quoted(got)),
    }
}

/// Text for a message: characters that do not print are escaped, and it is cut where it is unreasonably long.
fn quoted(text: &str) -> String {
    const SHOWN: usize = 40;
    let shown: String = text.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    let dots = if text.chars().nth(SHOWN).is_some() { "..." } else { "" };
    format!("`{shown}{dots}`")
}
