// Settings by name, as the library takes them: the same rows as the program's flags, the same sentences.
#pragma once

#include "apps/json.h"
#include "apps/method_settings.h"
#include "apps/refine/refine.h"
#include "apps/relief/settings.h"
#include "apps/session/settings.h"

namespace scanshade::library {

/// What takes a setting. The program's flags about files of results belong to none of these.
enum class Purpose { session, capture };

/// The rows of `settings` that serve the purpose, grouped as in the help.
[[nodiscard]] std::vector<Stage> stages_for(Purpose purpose, RunSettings& settings);

/// Sets what was given and resolves it: a preset first, then those in a file, then the rest. Throws Misuse naming the
/// setting that is unknown, is one of the program alone, or is out of range.
void fill(RunSettings& settings, Purpose purpose, const Settings& given);
void fill(RefineSettings& settings, const Settings& given);
/// `of_file`: the heights are a file's, so that its band may be named.
void fill(relief::ReliefSettings& settings, bool of_file, const Settings& given);

/// {"radius": 0.5, "cacao.power": 1.5, ...}: those in use that shape a session's results.
[[nodiscard]] json values_in_use(RunSettings& settings);

/// Every setting of sessions, captures, refine and relief as scanshade_settings() has it.
[[nodiscard]] json all_settings();

} // namespace scanshade::library
