//! The files that a command writes. A failure of one does not keep the others from being written, and an incomplete result
//! does not replace a file of an earlier run.
use super::interrupt;
use crate::error::{Error, Result};
use crate::image::output::{self, Stream};
use crate::image::{self, Film, WriteOptions};
use crate::scene::Scene;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// A scene's name: that of its file, or of the folder of a file called "scene", as many are.
pub fn scene_name(path: &Path) -> OsString {
    let stem = path.file_stem().unwrap_or("image".as_ref()); // `.` and `..` have no file name
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let folder = whole.parent().and_then(Path::file_name).filter(|_| stem == "scene");
    folder.unwrap_or(stem).to_owned()
}

/// A file to write, and the function that writes its content.
pub struct Item<'a> {
    /// The requested path.
    pub path: PathBuf,
    /// The function that writes the content.
    pub fill: Fill<'a>,
}

/// Writes the content of a file. It is called again if writing to the first path fails.
type Fill<'a> = Box<dyn Fn(&mut dyn Stream) -> std::io::Result<()> + 'a>;

impl<'a> Item<'a> {
    /// An image in the format of the file extension.
    pub fn image(path: PathBuf, film: &'a Film, options: WriteOptions) -> Self {
        let name = path.clone();
        Self { path, fill: Box::new(move |stream| image::encode(&name, film, &options, stream)) }
    }

    /// A file with the given bytes.
    pub fn bytes(path: PathBuf, bytes: Vec<u8>) -> Self {
        Self { path, fill: Box::new(move |stream| stream.write_all(&bytes)) }
    }
}

/// The files written by one run.
#[derive(Default)]
pub struct Files {
    /// Paths of the files that this run has written and may replace, by their requested paths with links followed.
    own: BTreeMap<PathBuf, PathBuf>,
    /// Requested paths that could not be written, with the error and where the file is instead.
    failures: Vec<(PathBuf, String)>,
    /// Whether the same command makes them again. What cannot be written is not put elsewhere then.
    again: bool,
}

/// Name for an incomplete file: `a.partial.exr` for `a.exr`.
pub fn partial_name(path: &Path) -> PathBuf {
    output::with_suffix(path, ".partial")
}

/// The first of the paths whose format holds all layers.
pub fn first_with_layers(paths: &[PathBuf]) -> Option<&PathBuf> {
    paths.iter().find(|path| image::has_layers(path))
}

/// A key that is the same for all paths of one file.
pub fn key(path: &Path) -> PathBuf {
    output::resolve(path).unwrap_or_else(|_| path.to_owned())
}

impl Files {
    /// `resumed` is the file that this run continues and therefore may replace.
    pub fn new(resumed: Option<&Path>) -> Self {
        let own = resumed.map(|path| (key(path), path.to_owned())).into_iter().collect();
        Self { own, ..Self::default() }
    }

    /// Those of a frame. The same command renders a frame again whose files are missing, and frames that were put elsewhere would
    /// pile up there with each run.
    pub fn of_frame() -> Self {
        Self { again: true, ..Self::default() }
    }

    /// From now on what is written to `path` goes to `place`, because an earlier run of the same work put it there.
    pub fn go_on(&mut self, path: &Path, place: PathBuf) {
        self.own.insert(key(path), place);
    }

    /// Where what is written to `path` goes, if that is a file of this work.
    pub fn place_of(&self, path: &Path) -> Option<PathBuf> {
        self.own.get(&key(path)).cloned()
    }

    /// Removes the incomplete files that this run owns, once the items are whole.
    pub fn remove_partial(&mut self, items: &[Item]) {
        for partial in items.iter().map(|item| partial_name(&item.path)) {
            if let Some(place) = self.own.remove(&key(&partial)) {
                let _ = std::fs::remove_file(place);
            }
        }
    }

    /// Writes all items that are regular files and returns their paths. If the result is not `whole`, a file of an earlier run
    /// is kept and [`partial_name`] is used instead. Signals take effect only after all are written. Pipes are left to
    /// [`Self::pipe`].
    pub fn save(&mut self, items: &[Item], whole: bool) -> Vec<PathBuf> {
        interrupt::flag();
        let files = items.iter().filter(|item| !output::is_special(&item.path));
        files.filter_map(|item| self.save_one(item, whole)).collect()
    }

    /// Writes the items that are pipes or devices and returns their paths. A pipe may have no reader, so a signal ends the
    /// process at once where there is one. So does one that came while the other files were written, unless it is the reason
    /// why they are not `whole`.
    pub fn pipe(&mut self, items: &[Item], whole: bool) -> Vec<PathBuf> {
        let pipes = items.iter().filter(|item| output::is_special(&item.path));
        let written = pipes.filter_map(|item| self.pipe_one(item, whole)).collect();
        interrupt::flag();
        written
    }

    /// From here on a signal ends the process at once: the last of its files is written, and what it prints may have no reader.
    pub fn end(&self) {
        interrupt::leave_at_once("interrupted: all files are written");
    }

    /// Whether all was written so far.
    ///
    /// # Errors
    /// [`Error::Output`] with all failures.
    pub fn check(&self) -> Result<()> {
        let Some(((path, first), more)) = self.failures.split_first() else { return Ok(()) };
        let more = more.iter().map(|(path, what)| format!("; {}: {what}", path.display())).collect::<String>();
        Err(Error::output(path, format!("{first}{more}")))
    }

    /// Appends all failures so far to `line`.
    pub fn with_failures(&self, line: &str) -> String {
        self.check().map_or_else(|e| format!("{line}; {e}"), |()| line.to_owned())
    }

    fn save_one(&mut self, item: &Item, whole: bool) -> Option<PathBuf> {
        let taken = !self.own.contains_key(&key(&item.path)) && item.path.try_exists().unwrap_or(true);
        let saved = if whole || !taken { self.replace(item) } else { self.add(&partial_name(&item.path), item) };
        saved.map_or_else(|e| self.put_elsewhere(item, &e), Some)
    }

    fn pipe_one(&mut self, item: &Item, whole: bool) -> Option<PathBuf> {
        let line = format!("interrupted: {} was not read to its end; all files are written", item.path.display());
        let line = self.with_failures(&line);
        if interrupt::leave_at_once(&line) && whole {
            interrupt::leave(&line);
        }
        match output::write_with(&item.path, |stream| (item.fill)(stream)) {
            Ok(()) => Some(item.path.clone()),
            Err(e) => self.put_elsewhere(item, &e),
        }
    }

    /// Writes to the requested path, or to where this run has written the file before.
    fn replace(&mut self, item: &Item) -> Result<PathBuf> {
        let key = key(&item.path);
        let place = self.own.get(&key).cloned().unwrap_or_else(|| item.path.clone());
        output::write_with(&place, |stream| (item.fill)(stream))?;
        self.own.insert(key, place.clone());
        Ok(place)
    }

    /// Writes to `path` if this run has written it before, else to a new file of that name or of that name with a number.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn add(&mut self, path: &Path, item: &Item) -> Result<PathBuf> {
        let key = key(path);
        if let Some(place) = self.own.get(&key) {
            output::write_with(place, |stream| (item.fill)(stream))?;
            return Ok(place.clone());
        }
        let place = output::write_new(path, |stream| (item.fill)(stream))?;
        self.own.insert(key, place.clone());
        Ok(place)
    }

    /// Saves a file that could not be written in the working folder or in the folder for temporary files, unless it is made again.
    fn put_elsewhere(&mut self, item: &Item, failure: &Error) -> Option<PathBuf> {
        let name = item.path.file_name()?;
        let places = [PathBuf::from(name), std::env::temp_dir().join(name)];
        let mut places = places.iter().filter(|_| !self.again);
        let put = places.find_map(|place| output::write_new(place, |stream| (item.fill)(stream)).ok());
        let failure = match failure {
            Error::Output { what, .. } => what.clone(),
            other => other.to_string(),
        };
        let what = match &put {
            Some(place) => format!("{failure} (it is in {} instead)", place.display()),
            None => failure,
        };
        self.failures.push((item.path.clone(), what));
        if let Some(place) = &put {
            self.own.insert(key(&item.path), place.clone());
        }
        put
    }
}

/// Checks that no output is the same file as another output or an input. Each is given as the option or another name for
/// messages, and a path. Pipes and devices may be written to more than once.
///
/// # Errors
/// [`Error::Usage`].
pub fn check_distinct(outputs: &[(&str, &Path)], inputs: &[(&str, &Path)]) -> Result<()> {
    let outputs: Vec<_> = outputs.iter().filter(|(_, path)| !output::is_special(path)).collect();
    for (i, (option, path)) in outputs.iter().enumerate() {
        let others = outputs[..i].iter().copied().chain(inputs);
        if let Some((other, _)) = others.into_iter().find(|(_, taken)| key(taken) == key(path)) {
            let path = path.display();
            return Err(Error::Usage(format!("{option} {path} is the same file as {other}: choose another name")));
        }
    }
    Ok(())
}

/// Checks that none of the outputs, given by their options, is a file that the scene is made of, to be lost with all later renders.
///
/// # Errors
/// [`Error::Usage`].
pub fn check_not_of_scene(outputs: &[(&str, PathBuf)], scene: &Scene) -> Result<()> {
    let existing: Vec<_> = outputs.iter().filter(|(_, path)| path.exists() && !output::is_special(path)).collect();
    if existing.is_empty() {
        return Ok(());
    }
    let files: BTreeMap<_, _> = scene.files.iter().map(|file| (key(file), file)).collect();
    for (option, path) in existing {
        if let Some(file) = files.get(&key(path)) {
            let remedy = if option.starts_with('-') { option } else { "-o" };
            let (path, file) = (path.display(), file.display());
            return Err(Error::Usage(format!(
                "{option} {path} would replace {file}, of which the scene is made: choose another name with {remedy}"
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(path: &Path, text: &str) -> Item<'static> {
        Item::bytes(path.to_owned(), text.into())
    }

    fn read(path: &Path) -> String {
        std::fs::read_to_string(path).unwrap()
    }

    #[test]
    fn scenes_have_names() {
        let paths = ["scenes/bust/scene.toml", "a/scene.gltf", "a/room.toml", "/scene.toml", ".."];
        assert_eq!(paths.map(|path| scene_name(Path::new(path))), ["bust", "a", "room", "scene", "image"]);
        let here = std::env::current_dir().unwrap();
        assert_eq!(
            ["scene.toml", "./scene.toml"].map(|path| scene_name(Path::new(path))),
            [here.file_name().unwrap(); 2]
        );
    }

    #[test]
    fn what_is_not_whole_replaces_nothing_but_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let inside = |name: &str| folder.path().join(name);
        let (old, fresh, resumed) = (inside("old.exr"), inside("fresh.exr"), inside("resumed.exr"));
        for path in [&old, &resumed, &inside("old.partial.exr")] {
            std::fs::write(path, "old").unwrap();
        }
        let mut files = Files::new(Some(&resumed));
        let save = |files: &mut Files, text, whole| {
            files.save(&[item(&old, text), item(&fresh, text), item(&resumed, text)], whole)
        };
        let beside = inside("old.partial-2.exr");
        assert_eq!(save(&mut files, "first", false), [beside.clone(), fresh.clone(), resumed.clone()]);
        assert_eq!(save(&mut files, "second", false), [beside.clone(), fresh.clone(), resumed.clone()]);
        assert_eq!([&beside, &fresh, &resumed].map(|path| read(path)), ["second"; 3]);
        assert_eq!([&old, &inside("old.partial.exr")].map(|path| read(path)), ["old"; 2]);
        save(&mut files, "whole", true);
        assert_eq!(read(&old), "whole");
        assert!(files.check().is_ok());
    }

    #[test]
    fn one_file_by_two_names_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let inside = |name: &str| folder.path().join(name);
        let [a, b, link, roundabout] = ["a.exr", "b.exr", "link.exr", "x/../a.exr"].map(inside);
        std::fs::create_dir(inside("x")).unwrap();
        let check = |outputs: [&Path; 2], input: &Path| {
            check_distinct(&[("-o", outputs[0]), ("--heatmap", outputs[1])], &[("the scene", input)])
        };
        let refused = |outputs, input, word: &str| {
            let line = check(outputs, input).unwrap_err().to_string();
            assert!(line.contains(word), "{line}");
        };
        refused([&a, &roundabout], &b, "same file as -o");
        refused([&a, &b], &roundabout, "same file as the scene");
        check([&a, &b], &link).unwrap();
        #[cfg(unix)]
        {
            // It leads to a file that does not exist yet.
            std::os::unix::fs::symlink(&a, &link).unwrap();
            refused([&b, &link], &a, "--heatmap");
            check([Path::new("/dev/null"), Path::new("/dev/null")], Path::new("/dev/null")).unwrap();
        }
    }
}
