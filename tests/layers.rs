//! Layers of the crate: folders import as the table says, files of a folder without circles, and never their own `mod.rs`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Folders and what each may import besides `error`, `constants` and `cancel`.
const LAYERS: [(&str, &str); 11] = [
    ("numeric", ""),
    ("geometry", "numeric"),
    ("antennas", "numeric"),
    ("rays", "geometry numeric"),
    ("synthesis", "numeric"),
    ("paths", "synthesis antennas geometry numeric"),
    ("scattering", "paths rays antennas geometry numeric"),
    ("bounces", "scattering paths synthesis rays antennas geometry numeric"),
    ("processing", "numeric"),
    (
        "frame",
        "bounces synthesis scattering paths rays antennas geometry numeric",
    ),
    (
        "python",
        "frame bounces synthesis processing scattering paths rays antennas geometry numeric",
    ),
];

/// Sources without tests and comments, by module path; the path of lib.rs is empty.
fn modules(directory: &Path, path: &str, found: &mut BTreeMap<String, String>) {
    for entry in std::fs::read_dir(directory).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        let stem = name.trim_end_matches(".rs");
        let inner = [path, stem].join(if path.is_empty() { "" } else { "::" });
        if name == "tests" {
            continue;
        }
        if entry.path().is_dir() {
            modules(&entry.path(), &inner, found);
        } else if !["lib.rs", "tests.rs"].contains(&name.as_str()) {
            let source = std::fs::read_to_string(entry.path()).unwrap();
            let code = source.split("\n#[cfg(test)]\n").next().unwrap().lines();
            let code = code.map(|line| line.split("//").next().unwrap());
            let module = if stem == "mod" { path.to_owned() } else { inner };
            found.insert(module, code.collect::<Vec<_>>().join("\n"));
        }
    }
}

/// Paths that a piece of a `use` tree names: `a::{b, c::d}` is `a::b` and `a::c::d`.
fn expand(prefix: &str, tree: &str) -> Vec<String> {
    let end = tree.find(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
    let path = format!("{prefix}{}", &tree[..end.unwrap_or(tree.len())]);
    if !tree[path.len() - prefix.len()..].starts_with('{') {
        return vec![path];
    }
    let inside = tree.split_once('{').unwrap().1.split_once('}').unwrap().0;
    inside.split(',').flat_map(|item| expand(&path, item.trim())).collect()
}

/// Modules that a module names by `crate::` or `super::`.
fn imports(module: &str, code: &str, modules: &BTreeMap<String, String>) -> BTreeSet<String> {
    let parent = |module: &str| {
        module
            .rsplit_once("::")
            .map_or(String::new(), |(parent, _)| parent.to_owned())
    };
    let from_crate = code.split("crate::").skip(1).flat_map(|tree| expand("", tree));
    let from_super = code
        .split("super::")
        .skip(1)
        .flat_map(|tree| expand(&format!("{}::", parent(module)), tree));
    let nearest = |path: String| {
        let mut path = path;
        while !path.is_empty() && !modules.contains_key(&path) {
            path = parent(&path);
        }
        path
    };
    from_crate.chain(from_super).map(nearest).collect()
}

/// True if a path along imports leads from a module back to itself.
fn is_in_circle(start: &str, imports: &BTreeMap<String, BTreeSet<String>>) -> bool {
    let (mut seen, mut rest) = (BTreeSet::new(), vec![start]);
    while let Some(module) = rest.pop() {
        for next in imports.get(module).into_iter().flatten() {
            if next == start {
                return true;
            }
            if seen.insert(next) {
                rest.push(next);
            }
        }
    }
    false
}

#[test]
fn imports_follow_the_layers() {
    let mut all = BTreeMap::new();
    modules(&Path::new(env!("CARGO_MANIFEST_DIR")).join("rust"), "", &mut all);
    let (mut wrong, mut siblings) = (Vec::new(), BTreeMap::<String, BTreeSet<String>>::new());
    for (module, code) in &all {
        for import in imports(module, code, &all) {
            let [from, to] = [module, &import].map(|path| path.split("::").collect::<Vec<_>>());
            let may = LAYERS
                .iter()
                .find(|layer| layer.0 == from[0])
                .map_or("", |layer| layer.1);
            let is_common = ["error", "constants", "cancel"].contains(&to[0]);
            if from[0] != to[0] && !is_common && !may.split(' ').any(|folder| folder == to[0]) {
                wrong.push(format!("{module} may not import {import}"));
            }
            let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if from.len() > shared && to.len() == shared {
                wrong.push(format!("{module} imports the mod.rs round it, {import}"));
            } else if from.len() > shared && to.len() > shared {
                let sibling = |path: &[&str]| path[..=shared].join("::");
                siblings.entry(sibling(&from)).or_default().insert(sibling(&to));
            }
        }
    }
    let circles = siblings.keys().filter(|module| is_in_circle(module, &siblings));
    wrong.extend(circles.map(|module| format!("{module} imports itself by way of its siblings")));
    assert!(all.len() > 50, "sources are missing");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
