//! The albedo of files, which light is divided by before it is filtered and multiplied with after.
use super::Layers;
use crate::image::aov::Aov;
use crate::layout::vec3;
use crate::shaders::shared::albedo::SMALLEST_ALBEDO;

impl Layers<'_> {
    /// Albedo of a pixel, as other renderers have it cut to [0, 1]: light that is multiplied by more would leave false
    /// highlights.
    pub(super) fn albedo(&self, i: usize) -> vec3 {
        let told = self.told(i);
        if self.aovs.is_tallow_s() { told } else { told.map(|v| v.clamp(0.0, 1.0)) }
    }

    fn told(&self, i: usize) -> vec3 {
        self.aovs.get(Aov::Albedo).map_or([0.0; 3], |plane| plane.at(i))
    }

    /// Whether any pixel has an albedo. Says where it is not taken as it is, and which surfaces cannot be filtered.
    pub(super) fn judge_albedo(&mut self) -> bool {
        if self.aovs.get(Aov::Albedo).is_none() || self.aovs.is_tallow_s() {
            return self.aovs.get(Aov::Albedo).is_some();
        }
        let of = self.aovs.film.pixels();
        let count = |is: &dyn Fn(usize) -> bool| (0..of).filter(|&i| is(i)).count();
        let above = count(&|i| self.told(i).iter().any(|&v| v > 1.0));
        let without = |i: usize| !self.told(i).iter().any(|&v| v > SMALLEST_ALBEDO);
        let any = (0..of).any(|i| !without(i));
        // Of files with variance, that tells mirrors and glass from lamps.
        let measured = self.aovs.get(Aov::Variance).is_some();
        let stay = count(&|i| !measured && without(i) && self.places.at(self.aovs, i).1 > 0.0);
        let notes = [
            (above > 0, format!("albedo: above 1 in {above} of {of} pixels, and cut to 1 there")),
            (!any, "albedo: 0 in all pixels, as if it were not there".to_owned()),
            (
                any && stay > 0,
                format!(
                    "albedo: none on surfaces in {stay} of {of} pixels (mirrors, glass, lamps), which stay as they are: \
                     with a layer of variance, those that are noisy are filtered too"
                ),
            ),
        ];
        self.notes.extend(notes.into_iter().filter(|(there, _)| *there).map(|(_, note)| note));
        any
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::aov::{Aovs, Names};
    use crate::image::{Film, Samples};

    const RGB: [&str; 3] = ["R", "G", "B"];
    /// Colour, albedo and depth.
    type Column = [f32; 3];

    /// Pixels of these columns.
    fn film(columns: [Column; 3]) -> Film {
        let vectors = |what: usize| columns.map(|column| [column[what]; 3]);
        let mut film = Film::new(3, 1);
        film.add_vec3("", RGB, &vectors(0));
        film.add_vec3("albedo", RGB, &vectors(1));
        film.add("Z", Samples::F32(columns.map(|column| column[2]).to_vec()));
        film
    }

    /// Albedo, whether any counts, and all notes.
    fn taken(film: &Film) -> (Vec<f32>, bool, String) {
        let aovs = Aovs::find(film, &Names::new()).unwrap();
        let layers = Layers::new(&aovs);
        let albedo = (0..3).map(|i| layers.guide(i).albedo[0]).collect();
        (albedo, layers.holds().albedo, layers.notes.join("\n"))
    }

    #[test]
    fn albedo_above_1_is_1_but_for_our_own() {
        let mut file = film([[1.0, 0.5, 2.0], [1.0, 5.98, 2.0], [1.0, -1.0, 0.0]]);
        let (albedo, known, notes) = taken(&file);
        assert_eq!((albedo, known), (vec![0.5, 1.0, 0.0], true));
        assert!(notes.contains("albedo: above 1 in 1 of 3 pixels"), "{notes}");
        file.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
        assert_eq!(taken(&file).0, [0.5, 5.98, -1.0]);
    }

    #[test]
    fn surfaces_without_albedo_are_told_where_no_variance_tells_which_are_noisy() {
        let [wall, glass, sky] = [[1.0, 0.5, 2.0], [3.0, 0.0, 2.0], [7.0, 0.0, 0.0]];
        let mut file = film([wall, glass, sky]);
        let (_, known, notes) = taken(&file);
        assert!(known && notes.contains("albedo: none on surfaces in 1 of 3 pixels"), "{notes}");
        file.add_vec3("variance", RGB, &[[1.0; 3]; 3]);
        assert!(!taken(&file).2.contains("albedo: none"));
    }

    #[test]
    fn albedo_that_is_0_everywhere_is_as_if_it_were_not_there() {
        let (_, known, notes) = taken(&film([[1.0, 0.0, 2.0]; 3]));
        assert!(!known && notes.contains("albedo: 0 in all pixels"), "{notes}");
    }
}
