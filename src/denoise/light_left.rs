//! How much of an image's light a filter leaves.
use super::Colour;
use crate::image::aov::{Aov, Aovs};

/// Share of the light above which a loss is not worth a word.
const UNTOLD: f64 = 0.95;
/// Standard errors of the noisy image's mean that chance may explain.
const BY_CHANCE: f64 = 3.0;

/// A line for the user where `clean`, which a filter made of the image, has less light than it, by more than chance explains. `None` also
/// where the image does not tell its variance.
pub fn note_of_lost_light(aovs: &Aovs, clean: &Colour) -> Option<String> {
    let noisy = aovs.get(Aov::Colour)?;
    let [mut before, mut after, mut squares] = [0.0; 3];
    // Pixels without a sample have no light before, but what was filled in behind.
    let sampled = |&i: &usize| aovs.holds(i) && aovs.samples(i).is_none_or(|samples| samples > 0.0);
    for i in (0..clean[0].len()).filter(sampled) {
        let (noisy, variance) = (noisy.at(i), aovs.variance(i)?);
        if noisy.iter().chain(&variance).all(|v| v.is_finite()) {
            before += noisy.map(f64::from).iter().sum::<f64>();
            after += clean.iter().map(|plane| f64::from(plane[i])).sum::<f64>();
            // Channels of one path rise and fall together: their deviations add.
            squares += variance.map(|v| f64::from(v).max(0.0).sqrt()).iter().sum::<f64>().powi(2);
        }
    }
    let told = squares > 0.0 && after < UNTOLD * before && before - after > BY_CHANCE * squares.sqrt();
    told.then(|| {
        let left = 100.0 * after / before;
        format!("light: {left:.0} % of it is left, since a few bright samples look like noise: more samples keep more")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::aov::Names;
    use crate::image::{Film, Samples};

    /// Of 100 pixels of 1 whose means have this deviation: their sum has one of ten times that.
    #[test]
    fn a_loss_is_told_that_is_no_chance() {
        let told = |deviation: f32, left: f32| {
            let mut film = Film::new(10, 10);
            film.add_vec3("", ["R", "G", "B"], &[[1.0; 3]; 100]);
            film.add_vec3("variance", ["R", "G", "B"], &[[deviation * deviation; 3]; 100]);
            note_of_lost_light(&Aovs::find(&film, &Names::new()).unwrap(), &[0; 3].map(|_| vec![left; 100]))
        };
        assert_eq!(told(0.5, 0.84).map(|note| note.starts_with("light: 84 % of it is left")), Some(true));
        assert_eq!([told(0.5, 0.86), told(0.1, 0.96), told(0.1, 1.2), told(0.0, 0.5)], [const { None }; 4]);
    }

    /// Half of the pixels have no sample, but come out as bright as the others, of which half of the light is left.
    #[test]
    fn what_fills_pixels_without_a_sample_makes_up_for_no_loss() {
        let mut film = Film::new(10, 10);
        let half: Vec<_> = (0..100).map(|i| (i % 2) as f32).collect();
        film.add_vec3("", ["R", "G", "B"], &half.iter().map(|&v| [v; 3]).collect::<Vec<_>>());
        film.add_vec3("variance", ["R", "G", "B"], &half.iter().map(|&v| [0.01 * v; 3]).collect::<Vec<_>>());
        film.add("samples", Samples::F32(half));
        let note = note_of_lost_light(&Aovs::find(&film, &Names::new()).unwrap(), &[0; 3].map(|_| vec![0.5; 100]));
        assert!(note.as_ref().is_some_and(|note| note.starts_with("light: 50 % of it is left")), "{note:?}");
    }
}
