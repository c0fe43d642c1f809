//! Tests the order of the modules: which ones import which, without circles, and which ones may contain Vulkan, `unsafe` and code
//! that only a program needs.
use crate::files_below;
use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

/// Words that only one module may hold: those of Vulkan, and of what an engine does without (the feature `cli`).
const ROOMS: &[(&str, &[&str])] = &[("gpu", &["unsafe", "vk", "ash"]), ("cli", &["clap", "signal_hook", "indicatif"])];

/// A module's path below the crate, or the path of an item in one.
type Names = Vec<String>;

/// A source file: its name, and what its tokens name outside of tests.
struct Source {
    file: String,
    /// Path of its module: empty for `lib.rs`.
    module: Names,
    /// Absolute paths of what it names in this crate.
    named: BTreeSet<Names>,
    /// What it calls others by: the name that an import gives, and its path.
    imports: BTreeMap<String, Names>,
    /// First names of all paths, and the word `unsafe`; those in tests too.
    words: BTreeSet<String>,
}

impl Source {
    fn new(file: &str, text: &str) -> Self {
        let inner: Names = file.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
        let module = match inner.last().map(String::as_str) {
            Some("mod") => inner[..inner.len() - 1].to_vec(),
            Some("lib") => Vec::new(),
            _ => inner,
        };
        let (named, imports, words) = Default::default();
        let mut source = Self { file: file.to_owned(), module, named, imports, words };
        let tokens: TokenStream = text.parse().unwrap_or_else(|e| panic!("{file}: {e}"));
        let children = child_modules(&tokens);
        source.read(tokens, &children, file.ends_with("tests.rs"));
        source
    }

    fn read(&mut self, tokens: TokenStream, children: &BTreeSet<String>, test: bool) {
        let tokens: Vec<_> = tokens.into_iter().collect();
        let (mut at, mut test_item) = (0, false);
        while at < tokens.len() {
            match &tokens[at] {
                TokenTree::Group(group) if at > 0 && is_mark(&tokens[at - 1], '#') => {
                    let text = group.stream().to_string().replace(' ', "");
                    test_item |= text == "cfg(test)";
                    if !text.starts_with("cfg_attr(feature=\"cli\"") {
                        self.read(group.stream(), children, true);
                    }
                }
                TokenTree::Group(group) => {
                    self.read(group.stream(), children, test || test_item);
                    test_item &= group.delimiter() != Delimiter::Brace;
                }
                mark if is_mark(mark, ';') => test_item = false,
                TokenTree::Ident(word) if word == "use" => {
                    let end = (at..tokens.len()).find(|&i| is_mark(&tokens[i], ';')).unwrap_or(tokens.len());
                    let mut found = Vec::new();
                    use_tree(&tokens[at + 1..end], &Vec::new(), &mut found);
                    found.into_iter().for_each(|(path, name)| self.add(path, Some(name), children, test || test_item));
                    (at, test_item) = (end, false);
                }
                TokenTree::Ident(_) => {
                    let (path, end) = path_at(&tokens, at);
                    let member = at > 0 && is_mark(&tokens[at - 1], '.');
                    if !member && (end > at + 1 || path == ["unsafe"]) {
                        self.add(path, None, children, test || test_item);
                    }
                    at = end - 1;
                }
                _ => {}
            }
            at += 1;
        }
    }

    fn add(&mut self, path: Names, name: Option<String>, children: &BTreeSet<String>, test: bool) {
        self.words.extend(path.first().cloned());
        if let (Some(absolute), false) = (self.absolute(&path, children), test) {
            self.imports.extend(name.map(|name| (name, absolute.clone())));
            self.named.insert(absolute);
        }
    }

    /// From the crate's root on; `None` for what is not in the crate.
    fn absolute(&self, path: &[String], children: &BTreeSet<String>) -> Option<Names> {
        let ups = path.iter().take_while(|name| *name == "super").count();
        let (base, rest) = match path.first()?.as_str() {
            "crate" => (&[][..], &path[1..]),
            "self" => (&self.module[..], &path[1..]),
            "super" => (&self.module[..self.module.len().checked_sub(ups)?], &path[ups..]),
            child if children.contains(child) => (&self.module[..], path),
            _ => return None,
        };
        Some(base.iter().chain(rest).cloned().collect())
    }
}

fn is_mark(token: &TokenTree, mark: char) -> bool {
    matches!(token, TokenTree::Punct(found) if found.as_char() == mark)
}

/// Names of the modules that a file declares.
fn child_modules(tokens: &TokenStream) -> BTreeSet<String> {
    let tokens: Vec<_> = tokens.clone().into_iter().collect();
    let declared = tokens.windows(3).filter(|w| matches!(&w[0], TokenTree::Ident(word) if word == "mod"));
    declared.filter(|w| is_mark(&w[2], ';')).map(|w| w[1].to_string()).collect()
}

/// The names joined by `::` from a name on, and where they end.
fn path_at(tokens: &[TokenTree], start: usize) -> (Names, usize) {
    let (mut path, mut at) = (vec![tokens[start].to_string()], start + 1);
    while let [colon, second, TokenTree::Ident(name), ..] = &tokens[at..]
        && is_mark(colon, ':')
        && is_mark(second, ':')
    {
        path.push(name.to_string());
        at += 3;
    }
    // Before `{`, `<` and `*`, too, a name is the first of a path.
    let more = tokens.get(at..at + 2).is_some_and(|two| two.iter().all(|token| is_mark(token, ':')));
    (path, if more { at + 2 } else { at })
}

/// The paths of an import, and the names that it gives them.
fn use_tree(tokens: &[TokenTree], prefix: &Names, found: &mut Vec<(Names, String)>) {
    for branch in tokens.split(|token| is_mark(token, ',')) {
        let (mut path, mut alias) = (prefix.clone(), None);
        for (at, token) in branch.iter().enumerate() {
            match token {
                TokenTree::Group(group) => {
                    let inner: Vec<_> = group.stream().into_iter().collect();
                    use_tree(&inner, &path, found);
                    path.clear();
                }
                TokenTree::Ident(word) if word == "as" => {
                    alias = branch.get(at + 1).map(ToString::to_string);
                    break;
                }
                TokenTree::Ident(word) if word == "self" && !path.is_empty() => {}
                TokenTree::Ident(word) => path.push(word.to_string()),
                _ => {}
            }
        }
        let name = alias.or_else(|| path.last().cloned());
        found.extend(name.map(|name| (path, name)));
    }
}

/// All sources of the crate, by module.
struct House(BTreeMap<Names, Source>);

impl House {
    fn new(files: impl IntoIterator<Item = (String, String)>) -> Self {
        let sources = files.into_iter().map(|(file, text)| Source::new(&file, &text));
        Self(sources.map(|source| (source.module.clone(), source)).collect())
    }

    /// The module that a path leads to, through imports that pass a name on.
    fn module_of(&self, path: &[String], hops: usize) -> Names {
        let length = (0..=path.len()).rev().find(|&n| self.0.contains_key(&path[..n])).unwrap_or(0);
        let (module, rest) = path.split_at(length);
        let passed_on = rest.first().and_then(|name| self.0.get(module)?.imports.get(name));
        match passed_on.filter(|_| hops > 0) {
            Some(target) => self.module_of(&target.iter().chain(&rest[1..]).cloned().collect::<Names>(), hops - 1),
            None => module.to_vec(),
        }
    }

    /// Which module names which. A folder's own `mod.rs` may be named by all below it.
    fn edges(&self) -> impl Iterator<Item = (&Names, Names)> {
        let of = |source: &Source| -> Vec<Names> { source.named.iter().map(|path| self.module_of(path, 8)).collect() };
        let all = self.0.iter().flat_map(move |(module, source)| of(source).into_iter().map(move |to| (module, to)));
        all.filter(|(from, to)| !from.starts_with(to))
    }

    /// Which file names which, and which top-level module.
    fn known(&self) -> BTreeSet<(String, String)> {
        let name = |module: &Names| self.0[module].file.clone();
        let room = |module: &Names| module.first().cloned().unwrap_or_default();
        let both = |(from, to): (&Names, Names)| [(name(from), name(&to)), (room(from), room(&to))];
        self.edges().flat_map(both).filter(|(from, to)| from != to).collect()
    }

    /// Each circle of files, and of top-level modules, as a path.
    fn circles(&self) -> Vec<String> {
        circles(self.known().into_iter())
    }

    /// Words in the wrong room.
    fn strays(&self) -> Vec<String> {
        let of = |source: &Source| {
            let room = source.module.first().cloned().unwrap_or_default();
            let elsewhere = ROOMS.iter().filter(move |(owner, _)| *owner != room).flat_map(|(_, words)| *words);
            let found = elsewhere.filter(|word| source.words.contains(**word));
            found.map(|word| format!("{}: writes {word}", source.file)).collect::<Vec<_>>()
        };
        self.0.values().flat_map(of).collect()
    }
}

/// The shortest circle through each node that is in one; a circle is told once.
fn circles(edges: impl Iterator<Item = (String, String)>) -> Vec<String> {
    let mut next: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    edges.for_each(|(from, to)| _ = next.entry(from).or_default().insert(to));
    let mut told = BTreeMap::new();
    for start in next.keys() {
        if let Some(circle) = circle_through(start, &next) {
            let members: BTreeSet<_> = circle.iter().cloned().collect();
            told.entry(members).or_insert_with(|| circle.join(" -> "));
        }
    }
    told.into_values().collect()
}

fn circle_through(start: &String, next: &BTreeMap<String, BTreeSet<String>>) -> Option<Vec<String>> {
    let mut open = VecDeque::from([vec![start.clone()]]);
    let mut seen = BTreeSet::new();
    while let Some(path) = open.pop_front() {
        for to in path.last().and_then(|last| next.get(last)).into_iter().flatten() {
            let longer: Vec<_> = path.iter().chain([to]).cloned().collect();
            if to == start {
                return Some(longer);
            }
            if seen.insert(to.clone()) {
                open.push_back(longer);
            }
        }
    }
    None
}

fn house() -> House {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let files: Vec<_> =
        files_below(&root).into_iter().filter(|file| file.extension().is_some_and(|e| e == "rs")).collect();
    assert!(files.len() > 80, "the sources were not found");
    let inside = |file: &Path| file.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
    House::new(files.iter().map(|file| (inside(file), std::fs::read_to_string(file).unwrap())))
}

#[test]
fn no_file_and_no_module_is_in_a_circle() {
    let house = house();
    let found = house.circles();
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn vulkan_and_the_command_line_stay_in_their_rooms() {
    let found = house().strays();
    assert!(found.is_empty(), "{found:#?}");
}

fn planted(files: &[(&str, &str)]) -> House {
    House::new(files.iter().map(|(file, text)| ((*file).to_owned(), (*text).to_owned())))
}

#[test]
fn a_circle_is_found() {
    let of = |files: &[(&str, &str)]| planted(files).circles();
    let none: [&str; 0] = [];
    let two = [("a.rs", "use crate::b::B;"), ("b.rs", "fn f() { let quote = '\"'; crate::a::g() }")];
    assert_eq!(of(&two), ["a -> b -> a", "a.rs -> b.rs -> a.rs"]);
    let nested = [
        ("a/mod.rs", "mod x; mod y; pub use x::X;"),
        ("a/x.rs", "use {crate::{b, a::{y::{self as other}}}};"),
        ("a/y.rs", "use super::X;"),
        ("b.rs", "// crate::a\n/// [`crate::a`]\nconst NAME: &str = \"crate::a::X\";"),
    ];
    assert_eq!(of(&nested), ["a/x.rs -> a/y.rs -> a/x.rs"], "through what the folder passes on");
    let macros = [("a.rs", "fn f() { assert!(g(crate::b::B)) }"), ("b.rs", "fn f() { vec![crate::c::C] }")];
    assert_eq!(of(&macros), none);
    let three = [macros[0], macros[1], ("c.rs", "type T = Vec<crate::a::A>;")];
    assert_eq!(of(&three), ["a -> b -> c -> a", "a.rs -> b.rs -> c.rs -> a.rs"]);
    let tested = [two[0], ("b.rs", "#[cfg(test)] mod tests { use crate::a::A; } fn f() {}")];
    assert_eq!(of(&tested), none, "tests may look anywhere");
    let face = [("a/mod.rs", "mod x; fn f() { x::g() }"), ("a/x.rs", "use super::f;")];
    assert_eq!(of(&face), none, "a folder and what is in it");
    let above = [("a/mod.rs", "mod x; mod y; use x::X;"), ("a/x.rs", "use super::y::Y;"), ("a/y.rs", "use super::Z;")];
    assert_eq!(of(&above), none);
}

#[test]
fn a_stray_word_is_found() {
    let of = |file: &str, text: &str| planted(&[(file, text)]).strays();
    let none: [&str; 0] = [];
    assert_eq!(of("image/x.rs", "fn f() { let x = unsafe { 1 }; }"), ["image/x.rs: writes unsafe"]);
    assert_eq!(of("allocate.rs", "fn f(b: vk::Buffer) {} use ash::{vk};").len(), 2);
    assert_eq!(of("render.rs", "#[derive(clap::ValueEnum)] struct S;"), ["render.rs: writes clap"]);
    assert_eq!(of("render.rs", "#[cfg_attr(feature = \"cli\", derive(clap::ValueEnum))] struct S;"), none);
    assert_eq!(of("allocate.rs", "use hash::Hash; // unsafe\nfn f() { let c = '\"'; }"), none);
    assert_eq!(of("gpu/x.rs", "use ash::vk; fn f() { unsafe { g() } }"), none);
    assert_eq!(of("image.rs", "#[cfg(test)] mod tests { fn f() { unsafe { g() } } }"), ["image.rs: writes unsafe"]);
}
