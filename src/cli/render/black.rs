//! Why an image is black.
use crate::image::Film;
use crate::layout::NONE;
use crate::render::settings::Settings;
use crate::scene::Scene;

/// Why all of a finished film is black, as far as its layers tell; nothing of one that shows light, and of a scene of which nothing shines,
/// which is told when that is loaded.
pub fn why(film: &Film, scene: &Scene, settings: &Settings) -> Option<String> {
    let is_black =
        ["R", "G", "B"].iter().all(|name| film.floats(name).is_some_and(|values| values.iter().all(|v| *v == 0.0)));
    if !is_black || scene.lights.is_empty() {
        return None;
    }
    let ids = film.words("id").unwrap_or_default();
    let alike = ids.first().filter(|first| ids.iter().all(|id| id == *first));
    let name = |id: u32| scene.names.objects.get(id as usize).filter(|name| !name.is_empty());
    let depth = settings.max_depth;
    Some(match alike {
        Some(&NONE) => "the image is black: the camera sees neither a surface nor light of a sky".to_owned(),
        Some(&id) => format!(
            "the image is black: the camera sees one object alone{}, and no sample found light on it within max_depth {depth}: is the \
             camera inside it?",
            name(id).map_or_else(String::new, |name| format!(", \"{name}\""))
        ),
        None => format!(
            "the image is black: no sample found light on what the camera sees within max_depth {depth}: is the camera, or are the \
             lights, inside something closed?"
        ),
    })
}
