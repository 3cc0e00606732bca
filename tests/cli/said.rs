//! What commands say in cases that need only nine meshes and a few small files: the tables of `tests/cli/said`.

use crate::{Folder, in_repository};
use std::collections::BTreeSet;
use test_support::said::{assert_parts, play};

fn check(name: &str) {
    let folder = Folder::with_meshes();
    let table = in_repository("tests/cli/said").join(name).with_extension("txt");
    play(&table, folder.0.path(), |code, words, parts| {
        let said = folder.exits(code, words);
        assert_parts(words, &said, parts);
        assert!(!said.contains("panicked"), "{words}: {said}");
    });
}

macro_rules! tables {
    ($($name:ident,)*) => {
        $(#[test]
        fn $name() {
            check(stringify!($name));
        })*

        #[test]
        fn every_table_is_played() {
            let known = [$(stringify!($name)),*].map(|name| format!("{name}.txt"));
            let there = in_repository("tests/cli/said").read_dir().unwrap();
            let there = there.map(|file| file.unwrap().file_name().into_string().unwrap());
            assert_eq!(there.collect::<BTreeSet<_>>(), BTreeSet::from(known));
        }
    };
}

tables! {
    bad_meshes_are_named_and_the_others_go_on,
    cards_describe_finished_datasets,
    commands_have_the_same_names_of_models,
    corruptions_that_cannot_be_are_refused,
    datasets_in_use_need_overwrite,
    drives_that_cannot_be_made_leave_nothing,
    effects_work_in_scenes_datasets_and_drives,
    empty_sets_and_sensors_inside_meshes_are_warned_of,
    existing_outputs_are_replaced_only_if_asked,
    existing_tars_are_refused_without_resume,
    files_of_another_format_are_named,
    files_that_cannot_be_viewed_are_named,
    flags_that_do_not_fit_the_input_are_refused,
    meshes_of_another_unit_are_warned_of,
    missing_and_unreadable_files_are_named,
    numbers_of_another_unit_are_warned_of,
    one_configuration_is_advised,
    recipes_of_senseless_classes_are_refused,
    scans_unsuited_for_weather_are_refused,
    scenes_that_contradict_themselves_are_refused,
    senseless_commands_are_usage_errors,
    sensors_are_listed_and_described,
    sweeps_that_cannot_be_calibrated_are_refused,
    sweeps_of_another_origin_or_of_one_object_are_warned_of,
    tars_are_made_of_bad_meshes_and_of_a_billion_views,
    threads_that_do_not_start_are_named,
    unusable_sweeps_and_recipes_are_named,
    warnings_of_meshes_are_printed_once,
}
