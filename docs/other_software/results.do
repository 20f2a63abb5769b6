* Means over people by timing point, and a mixed model, from a results folder of jointz.
* Needs Stata 14 or later. Start it in the folder that contains results, or change the path.

* Text columns are named so that participant 01 keeps its zero.
import delimited using "results/estimates.csv", clear delimiters(",") varnames(1) ///
    case(preserve) asdouble encoding("utf-8") stringcols(1 2 4 6 13 14 15 16)
confirm variable participant timing_point onset_gait_pct parameter value unit ///
    ci_low ci_high ci_level vaf_pct n_used n_excluded method status session side
tabulate parameter status

keep if status == "ok"

* One row a person: the mean over the sessions and sides of the person.
collapse (mean) value, by(parameter timing_point participant)

preserve
collapse (mean) mean=value (sd) sd=value (count) people=value, by(parameter timing_point)
list, noobs sepby(parameter)
restore

* Does stiffness differ between timing points within people? The F test is in the header.
keep if parameter == "stiffness"
encode timing_point, generate(point)
encode participant, generate(person)
mixed value i.point || person:, reml dfmethod(kroger)
