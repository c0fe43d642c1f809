//! A glTF file in memory: what its JSON says, and its buffers.
use super::glb;
use super::uri::{self, Target};
use crate::error::{Error, Result};
use crate::image::input;
use crate::memory;
use gltf_json::Root;
use serde_json::Value;
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// A file that was read. Indices and lengths in `root` are as the file has them: see `check`.
pub struct Asset<'a> {
    /// Path of the file, for messages and for the files that it names.
    pub path: &'a Path,
    /// Folder that pictures are named relative to, where they lie below it.
    pub base: &'a Path,
    /// The JSON.
    pub root: Root,
    /// Contents of the buffers, each as long as the JSON says.
    pub buffers: Vec<Vec<u8>>,
}

/// Most bytes that the objects and list entries of the JSON take when they are parsed.
const BYTES_OF_OBJECT: u64 = 800;
const BYTES_OF_ENTRY: u64 = 72;

impl<'a> Asset<'a> {
    /// Reads a `.gltf` or `.glb` file and its buffers, but not its pictures. What it says is checked before its buffers are read, which
    /// extensions may leave out.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is no glTF 2.0, and for a buffer that is missing or too short; [`Error::Memory`]; those of `check`.
    pub fn read<T>(path: &'a Path, base: &'a Path, check: impl FnOnce(&Self) -> Result<T>) -> Result<(Self, T)> {
        let bytes = input::read(path)?;
        let (json, binary) = glb::split(&bytes).map_err(|what| Error::input(path, what))?;
        let count = |byte: u8| json.iter().filter(|&&b| b == byte).count() as u64;
        let parsed = BYTES_OF_OBJECT * count(b'{') + BYTES_OF_ENTRY * count(b',');
        memory::need(path.display(), parsed + 2 * json.len() as u64)?;
        let mut asset = Self { path, base, root: parse(path, json)?, buffers: Vec::new() };
        asset.check_version()?;
        let told = check(&asset)?;
        for index in 0..asset.root.buffers.len() {
            let content = asset.buffer(index, binary)?;
            asset.buffers.push(content);
        }
        Ok((asset, told))
    }

    /// An error at a place in the file.
    pub fn at(&self, place: impl Display, what: impl Display) -> Error {
        Error::input_at(self.path, place, what)
    }

    /// Folder that URIs are relative to.
    pub fn folder(&self) -> &'a Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Bytes of a buffer view.
    ///
    /// # Errors
    /// For a view that ends beyond its buffer.
    pub fn view(&self, index: usize) -> Result<&[u8]> {
        let at = |what: String| self.at(format!("buffer view {index}"), what);
        let none = || at(format!("is not there: there are {}", self.root.buffer_views.len()));
        let view = self.root.buffer_views.get(index).ok_or_else(none)?;
        let buffers = self.buffers.len();
        let named = view.buffer.value();
        let buffer = self.buffers.get(named).ok_or_else(|| at(format!("names buffer {named} of {buffers}")))?;
        let first = u128::from(view.byte_offset.unwrap_or_default().0);
        let end = first + u128::from(view.byte_length.0);
        match end <= buffer.len() as u128 {
            true => Ok(&buffer[first as usize..end as usize]),
            false => Err(at(format!("ends at byte {end} of buffer {named}, which has {}", buffer.len()))),
        }
    }

    /// Files of the buffers that are no part of the asset.
    pub fn buffer_files(&self) -> Vec<PathBuf> {
        let uris = self.root.buffers.iter().filter_map(|buffer| buffer.uri.as_deref());
        let file = |uri| match uri::resolve(self.folder(), uri) {
            Ok(Target::File(path)) => Some(path),
            _ => None,
        };
        uris.filter(|uri| !uri.starts_with("data:")).filter_map(file).collect()
    }

    fn check_version(&self) -> Result<()> {
        let asset = &self.root.asset;
        let newer = asset.min_version.as_deref().filter(|v| *v != "2.0");
        match newer.or(Some(&asset.version)).filter(|v| newer.is_some() || !v.starts_with("2.")) {
            Some(version) => {
                Err(Error::input(self.path, format!("is glTF of version {}: export it as glTF 2.0", one_line(version))))
            }
            None => Ok(()),
        }
    }

    /// The content of a buffer, cut to the length that the JSON gives.
    fn buffer(&self, index: usize, binary: Option<&[u8]>) -> Result<Vec<u8>> {
        let (buffer, place) = (&self.root.buffers[index], format!("buffer {index}"));
        let mut bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => match uri::resolve(self.folder(), uri).map_err(|what| self.at(&place, what))? {
                Target::Data(bytes) => bytes,
                Target::File(path) => input::read(&path)?,
            },
            (None, Some(binary)) if index == 0 => {
                memory::need(self.path.display(), binary.len() as u64)?;
                binary.to_vec()
            }
            (None, _) => return Err(self.at(place, "has no uri and no binary chunk: export the file again")),
        };
        let length = buffer.byte_length.0;
        if (bytes.len() as u64) < length {
            let what = format!("has {} bytes where {length} are announced: take another copy of it", bytes.len());
            return Err(self.at(place, what));
        }
        bytes.truncate(length as usize);
        Ok(bytes)
    }
}

fn parse(path: &Path, json: &[u8]) -> Result<Root> {
    serde_json::from_slice(json).or_else(|e| parse_leniently(json).ok_or(e)).map_err(|e| {
        let (text, place) = (e.to_string(), format!("line {}, column {}", e.line(), e.column()));
        let what = text.rsplit_once(" at line ").map_or(text.as_str(), |(what, _)| what);
        Error::input_at(path, place, format!("is no glTF: {}", one_line(what)))
    })
}

/// The file without what glTF allows and the parser refuses: keys that are repeated, integers that are written as `25.0` or
/// `1e2`, scenes without nodes, and animation channels that move no node, which extensions have.
fn parse_leniently(json: &[u8]) -> Option<Root> {
    fn list<'a>(value: &'a mut Value, key: &str) -> impl Iterator<Item = &'a mut Value> {
        value.get_mut(key).and_then(Value::as_array_mut).into_iter().flatten()
    }
    let mut root: Value = serde_json::from_slice(json).ok()?;
    make_integers(&mut root);
    for scene in list(&mut root, "scenes").filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    for channels in list(&mut root, "animations").filter_map(|animation| animation.get_mut("channels")?.as_array_mut())
    {
        channels.retain(|channel| channel.pointer("/target/node").is_some());
    }
    // By way of text, since reading a `Root` from a `Value` takes as much code once more.
    serde_json::from_slice(&serde_json::to_vec(&root).ok()?).ok()
}

/// Turns whole numbers from 0 to 2^53 into integers, which are read as either kind of number.
fn make_integers(value: &mut Value) {
    const LARGEST: f64 = 9_007_199_254_740_992.0;
    match value {
        Value::Array(list) => list.iter_mut().for_each(make_integers),
        Value::Object(object) => object.values_mut().for_each(make_integers),
        Value::Number(number) => {
            let whole = number.as_f64().filter(|v| number.is_f64() && v.fract() == 0.0 && (0.0..=LARGEST).contains(v));
            *value = whole.map_or_else(|| value.take(), |v| (v as u64).into());
        }
        _ => {}
    }
}

/// A name of the file as messages and reports show it: without line ends and other control characters, and not too long.
pub fn one_line(name: &str) -> String {
    const LONGEST: usize = 100;
    let plain = |c: char| if c.is_control() { '?' } else { c };
    let mut short: String = name.chars().take(LONGEST).map(plain).collect();
    if name.chars().nth(LONGEST).is_some() {
        short.push_str("...");
    }
    short
}
