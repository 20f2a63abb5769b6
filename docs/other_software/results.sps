* Encoding: UTF-8.
* Means over people by timing point, and a mixed model, from a results folder of jointz.
* Change the path to that of your folder.

SET DECIMAL=DOT.
GET DATA
  /TYPE=TXT
  /FILE='results/estimates.csv'
  /ENCODING='UTF8'
  /ARRANGEMENT=DELIMITED
  /DELCASE=LINE
  /FIRSTCASE=2
  /DELIMITERS=","
  /QUALIFIER='"'
  /VARIABLES=
    participant A64
    timing_point A64
    onset_gait_pct F20.0
    parameter A32
    value F20.0
    unit A32
    ci_low F20.0
    ci_high F20.0
    ci_level F20.0
    vaf_pct F20.0
    n_used F20.0
    n_excluded F20.0
    method A32
    status A64
    session A64
    side A16.
FORMATS onset_gait_pct vaf_pct (F8.2) value ci_low ci_high (F12.5) ci_level (F4.2)
  n_used n_excluded (F8.0).
FREQUENCIES VARIABLES=status.

SELECT IF (status = 'ok').

* One row a person: the mean over the sessions and sides of the person.
AGGREGATE
  /OUTFILE=*
  /BREAK=parameter timing_point participant
  /value=MEAN(value).
FORMATS value (F12.5).
MEANS TABLES=value BY parameter BY timing_point
  /CELLS=MEAN STDDEV COUNT.

* Does stiffness differ between timing points within people?.
SELECT IF (parameter = 'stiffness').
AUTORECODE VARIABLES=timing_point participant
  /INTO point person.
MIXED value BY point
  /FIXED=point | SSTYPE(3)
  /METHOD=REML
  /RANDOM=INTERCEPT | SUBJECT(person) COVTYPE(VC)
  /PRINT=SOLUTION
  /EMMEANS=TABLES(point) COMPARE ADJ(BONFERRONI).
